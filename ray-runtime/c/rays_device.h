/* What a device does beside measuring: whether its calibration still fits (rays_health), and two slots for a blob in NOR flash, of which
 * one is active, whatever happens (rays_storage). Both are the code of the Rust crate ray-device; its documentation has the reasons.
 *
 * Nothing is allocated. A rays_health and a rays_storage are plain memory of the caller's, started by their first function; they
 * may be moved in memory only before that, need no closing, and belong to one thread at a time. Link with librays.a, as for rays.h. */
#ifndef RAYS_DEVICE_H
#define RAYS_DEVICE_H

#include "rays.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Beside those of rays.h; they never change their meaning. */
enum {
    RAYS_BAD_FLASH = 160,       /* no flash that blobs can be kept in: see rays_flash */
    RAYS_FLASH_FAILED = 161,    /* a callback said that it failed, or what was programmed reads otherwise */
    RAYS_NO_BLOB = 162,         /* no slot has ever held a blob */
    RAYS_OTHER_PART = 163,      /* the slot was written for a flash of another unit or block */
    RAYS_NO_UPDATE = 164,       /* none was begun, or it failed */
    RAYS_BAD_CHUNK = 165,       /* empty, beyond the end, or no multiple of what is programmed at once though more follows */
    RAYS_TOO_LONG = 166,        /* longer than a slot, or shorter than any blob */
    RAYS_INCOMPLETE = 167,      /* bytes are missing; the update can go on */
    RAYS_LOG_FULL = 168,        /* no room for another rollback before the next update */
    RAYS_NOTHING_TO_ROLL_BACK_TO = 169
};

/* ---- Does the calibration still fit? ---- */

/* Memory for the gaps of the points measured so far: some 700 bytes. What is in it is the library's business. */
typedef struct {
    uint32_t opaque[224];
} rays_health;

/* What the gaps say. */
enum {
    RAYS_GAPS_NOTHING_PREDICTED = 0,
    RAYS_GAPS_TOO_FEW = 1,      /* fewer than 100 points */
    RAYS_GAPS_FIT = 2,          /* as predicted */
    RAYS_GAPS_SCATTER = 3,      /* larger than predicted, both ways: noisier pixels, wrong matches, or optics changed in places */
    RAYS_GAPS_SHIFTED = 4       /* one way: the cameras have moved against each other */
};

/* Gaps of `points` points, the older ones with less weight; mm. The last four compare with what the blob predicts, and are 0 where it
 * predicts nothing: of how many points, the mean predicted standard deviation, the mean gap in predicted standard deviations with
 * its sign (noise gives 0), and how much wider the gaps are than predicted (1: as predicted).
 * Gaps do not see what moves points within the plane of their two rays, such as another distance or angle between the cameras: only known
 * lengths show that. */
typedef struct {
    int verdict;
    uint32_t points;
    float mean_signed_mm;
    float mean_size_mm;
    float within_95_mm;
    uint32_t predicted_points;
    float mean_sigma_mm;
    float shift;
    float spread;
} rays_gaps;

/* Nothing measured yet. RAYS_OK, or RAYS_BAD_ARGUMENT for null. */
int rays_health_start(rays_health *health);

/* Counts a point, as rays_triangulate_with_covariance or ..._with_noise gave it. */
int rays_health_note(rays_health *health, const rays_measurement *measurement);

/* What has been counted; all zeros before the first point. */
int rays_health_report(const rays_health *health, rays_gaps *gaps);

/* ---- Two slots in flash ---- */

/* The flash of one slot, and how to reach it. Addresses count from the slot's start. Callbacks return 0 if all went well, and get `context`.
 *
 * unit: bytes programmed at once, 1 to 512, a power of two. block: bytes erased at once, a power of two, 64 or more and no less than
 * the unit. capacity: of the slot, whole blocks. erased: what a byte of an erased block reads as, 0xff or 0x00. no_erase: not 0 for memory that
 * can be programmed over (RRAM, FRAM). All of them are known at run time only: one library serves every part.
 *
 * mapped: where the slot can be read like memory, at a multiple of 8.
 * read: any range. A word that the chip cannot correct must make it return an error; on many parts it faults instead, and the
 *   callback must catch that.
 * program: whole units, each once between two erases. erase: whole blocks, and may take long. Both leave no stale bytes in a cache in
 *   front of `mapped`; nobody may read the chip meanwhile if it cannot be read while it is written.
 * is_blank: 1 if none of these bytes was programmed since they were erased, 0 if some were, negative if that cannot be told. NULL: read and
 *   compare, which is wrong only on parts whose blank words cannot be read.
 * step: called often during long steps, for a watchdog. NULL: none. */
typedef struct {
    void *context;
    const void *mapped;
    uint32_t capacity;
    uint32_t unit;
    uint32_t block;
    uint8_t erased;
    uint8_t no_erase;
    int (*read)(void *context, uint32_t address, void *bytes, size_t length);
    int (*program)(void *context, uint32_t address, const void *bytes, size_t length);
    int (*erase)(void *context, uint32_t address, uint32_t length);
    int (*is_blank)(void *context, uint32_t address, uint32_t length);
    void (*step)(void *context);
} rays_flash;

/* Memory for two slots. What is in it is the library's business. */
typedef struct {
    const void *opaque[96];
} rays_storage;

/* Decides which slot's blob is active and checks all of it; writes the decision down where the flash might say something else the next time. The
 * order of the slots is always the same. RAYS_OK also if neither holds a blob: rays_storage_blob says why. */
int rays_storage_start(rays_storage *storage, const rays_flash slots[2]);

/* The active blob, for rays_open; it stays in place until the next but one update begins. */
int rays_storage_blob(const rays_storage *storage, const void **blob, size_t *length);

/* Longest blob, bytes. */
int rays_storage_max_blob(const rays_storage *storage, size_t *length);

/* A new blob of so many bytes is coming. From here on the other slot's blob is gone; the active one is not touched. An update under way is
 * given up. Whose blob it is, is not asked: do that before. */
int rays_storage_begin(rays_storage *storage, size_t length);

/* Its next bytes: a multiple of the unit and of 8, but for the last ones. After RAYS_FLASH_FAILED the update is given up. */
int rays_storage_write(rays_storage *storage, const void *bytes, size_t length);

/* All bytes are there: reads them back, checks the blob as rays_open does, and makes it active, now and after any restart. A cut of
 * power at any moment leaves exactly the old or the new one. Rigs opened on the old blob can be used until the next rays_storage_begin. */
int rays_storage_finish(rays_storage *storage);

/* Makes the other slot's blob active, after a check of all of it. */
int rays_storage_rollback(rays_storage *storage);

#ifdef __cplusplus
}
#endif

#endif
