/* Opens a ray blob in place and answers which line in space a pixel sees, and which point two pixels see together.
 *
 * Nothing is allocated and nothing is copied: the blob stays where it is, in flash or in memory, at an address that is a
 * multiple of 8, unchanged for as long as its rig is used. A rig is plain memory of the caller's, initialized by rays_open;
 * it needs no closing, and once open it is only read, so any number of threads may use it.
 *
 * Pixels: the center of the sensor's top-left pixel is (0, 0), u right, v down. Lengths are millimeters, points and rays are
 * in the rig's frame. The same blob and pixels give the same bits on every target.
 *
 * Functions return RAYS_OK or say why there is no answer; what they were to write to is then left as it was.
 * Link with librays.a of your target and float ABI, and with -Wl,--gc-sections. On a Cortex-M with an FPU, switch it on
 * (CPACR) before the first call. */
#ifndef RAYS_H
#define RAYS_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The version of this header, and of the library it belongs to: rays_version() tells whether the two fit. */
#define RAYS_VERSION_MAJOR 0
#define RAYS_VERSION_MINOR 1
#define RAYS_VERSION_PATCH 0
#define RAYS_VERSION (10000 * RAYS_VERSION_MAJOR + 100 * RAYS_VERSION_MINOR + RAYS_VERSION_PATCH)

/* Codes never change their meaning; later versions may add some. */
enum {
    RAYS_OK = 0,

    /* Why a blob does not open. */
    RAYS_TRUNCATED = 1,        /* fewer bytes than it says it has, or than a header has */
    RAYS_BAD_MAGIC = 2,        /* no blob */
    RAYS_WRONG_VERSION = 3,    /* a blob of a version that this library does not read */
    RAYS_TRAILING_BYTES = 4,   /* more bytes than it says it has: see rays_stated_len */
    RAYS_BAD_CRC = 5,          /* damaged on the way */
    RAYS_MISALIGNED = 6,       /* not at a multiple of 8 */
    RAYS_BAD_HEADER = 7,       /* 7 to 14: not what FORMAT.md says, though the checksum fits */
    RAYS_BAD_META = 8,
    RAYS_BAD_PADDING = 9,
    RAYS_UNKNOWN_ENCODING = 10,
    RAYS_BAD_LAYOUT = 11,
    RAYS_BAD_NUMBER = 12,
    RAYS_BAD_PAIR = 13,
    RAYS_BAD_SECTION = 14,
    RAYS_UNKNOWN_SECTION = 15, /* it says what must be understood to answer rightly, and this library does not */
    RAYS_WRONG_ROUNDING = 16,  /* the processor does not round to nearest: set it so; nothing is wrong with the blob */

    /* Why a question has no answer. */
    RAYS_OUTSIDE = 64,         /* a pixel outside of its camera's calibrated area, or not a number */
    RAYS_NO_SUCH_CAMERA = 65,
    RAYS_TOO_FEW_RAYS = 66,    /* fewer than two sightings */
    RAYS_PARALLEL = 67,        /* the rays are parallel within 0.0002 rad */
    RAYS_BEHIND = 68,          /* the rays meet behind a camera */
    RAYS_UNSEEN = 69,          /* no pixel of the calibrated area was found to see the point */

    /* Why an image has no window. */
    RAYS_WRONG_SENSOR = 70,    /* calibrated on a sensor of another size; nothing is ever scaled */
    RAYS_NOT_ON_SENSOR = 71,   /* an empty image, a binning of 0, or more than the sensor has */

    /* Of this interface. */
    RAYS_BAD_ARGUMENT = 128,   /* a null pointer, or a length or a noise that there is not */
    RAYS_NOT_OPEN = 129,       /* the rig was not opened, or could not be */
    RAYS_SELF_TEST_FAILED = 130
};

/* Memory for a rig: 128 bytes where pointers have 32 bits. What is in it is the library's business. */
typedef struct {
    const void *opaque[32];
} rays_rig;

/* What a blob says of itself. The identity is a hash of the calibration: two blobs with the same one hold the same calibration,
 * however they are packed. max_error_px is the proven bound of what packing costs at any calibrated pixel, along the sensor;
 * working_distance_mm is where the calibration was made. */
typedef struct {
    uint8_t identity[16];
    float max_error_px;
    float working_distance_mm;
    size_t blob_len;
} rays_info;

/* A place on a sensor or an image. */
typedef struct {
    float u_px;
    float v_px;
} rays_pixel;

/* A camera of the blob. The name has name_len bytes of UTF-8 and no zero at its end; it lies in the blob. */
typedef struct {
    const char *name;
    size_t name_len;
    uint32_t sensor_width_px;
    uint32_t sensor_height_px;
} rays_camera;

/* A pixel of a camera; cameras count from 0 in the order of the blob. */
typedef struct {
    size_t camera;
    float u_px;
    float v_px;
} rays_sighting;

/* The points origin_mm + lambda * direction, lambda > 0 in front of the camera. The direction is not normalized. */
typedef struct {
    float origin_mm[3];
    float direction[3];
} rays_ray;

/* The middle of the common perpendicular of two rays, and the square of its length. */
typedef struct {
    float point_mm[3];
    float gap_squared_mm2;
} rays_point;

/* The same with the standard deviation along x, y and z: what the calibration leaves open and the pixels' noise.
 * has_sigma is 0, and sigma_mm too, where the blob says nothing of the uncertainty of these two cameras.
 * gap_mm is the gap with its sign, positive where the second camera's ray is above the first's, and gap_variance_mm2 (0 without sigma)
 * what its square should be on average. Gaps that are often larger, or mostly of one sign, say that the rig is no longer the
 * calibrated one: rays_health of rays_device.h keeps the count. */
typedef struct {
    float point_mm[3];
    float gap_squared_mm2;
    float sigma_mm[3];
    int has_sigma;
    float gap_mm;
    float gap_variance_mm2;
} rays_measurement;

/* A point on the ray of a pixel, and where another camera sees it. */
typedef struct {
    rays_pixel pixel;
    float point_mm[3];
} rays_curve_point;

/* What a camera reads out, in columns and rows: its whole sensor, the first pixel read, the image that comes out, and how many
 * sensor pixels make one of the image's (1: no binning). */
typedef struct {
    uint32_t sensor_px[2];
    uint32_t first_px[2];
    uint32_t image_px[2];
    uint32_t binning[2];
} rays_readout;

/* The map between an image and its sensor, made by rays_window_of. What is in it is the library's business. */
typedef struct {
    float opaque[6];
} rays_window;

/* How many of these bytes, a flash sector say, are the blob at their start. Only its first bytes are checked. */
int rays_stated_len(const void *bytes, size_t length, uint32_t *stated_len);

/* Checks the whole blob, `length` bytes and no more, and opens it in place. One pass over it. */
int rays_open(rays_rig *rig, const void *blob, size_t length);

/* RAYS_VERSION of the library. */
uint32_t rays_version(void);

int rays_info_of(const rays_rig *rig, rays_info *info);

/* 0 if the rig is not open. */
size_t rays_camera_count(const rays_rig *rig);

int rays_camera_of(const rays_rig *rig, size_t camera, rays_camera *info);

int rays_lookup(const rays_rig *rig, rays_sighting sighting, rays_ray *ray);

int rays_triangulate(const rays_rig *rig, rays_sighting first, rays_sighting second, rays_point *point);

/* The point nearest to the rays of `count` sightings, two or more, by least squares; gap_squared_mm2 is four times the mean square of its
 * distances from them. Two give the bits of rays_triangulate. Each ray is looked up about five times. */
int rays_triangulate_many(const rays_rig *rig, const rays_sighting *sightings, size_t count, rays_point *point);

/* About four times the work of rays_triangulate, whose bits the point has. */
int rays_triangulate_with_covariance(const rays_rig *rig, rays_sighting first, rays_sighting second,
                                     rays_measurement *measurement);

/* The same of pixels whose coordinates have the standard deviation noise_px, whatever the blob says of them: 0, or 1e-6 to 1000. */
int rays_triangulate_with_noise(const rays_rig *rig, rays_sighting first, rays_sighting second, float noise_px,
                                rays_measurement *measurement);

/* How noisy the blob says that the pixels of matches are; *noise_px becomes -1 where it says nothing, and they are taken to be as
 * exact as the corners of the calibration. */
int rays_match_noise(const rays_rig *rig, float *noise_px);

/* The pixel of a camera that sees a point of the rig's frame, to some 0.001 px; it costs 25 lookups and about ten for each of
 * some six steps. */
int rays_project(const rays_rig *rig, size_t camera, const float point_mm[3], rays_pixel *pixel);

/* The same without the 25, from a pixel nearby: that of the frame before, say. */
int rays_project_near(const rays_rig *rig, size_t camera, const float point_mm[3], rays_pixel start, rays_pixel *pixel);

/* Where the ray of a pixel appears in another camera: from far_mm to near_mm along the ray, `count` points at equal steps of the
 * inverse distance. `points` has room for all of them, at most 65535; *found becomes how many of them the other
 * camera sees, which stand first, from far to near. */
int rays_epipolar_curve(const rays_rig *rig, rays_sighting sighting, size_t other, float near_mm, float far_mm,
                        rays_curve_point *points, size_t count, size_t *found);

/* The map for a camera that reads out a part of its sensor, or bins it. */
int rays_window_of(const rays_rig *rig, size_t camera, const rays_readout *readout, rays_window *window);

/* The sensor's pixel at a pixel of the image: what rays_sighting wants. */
rays_pixel rays_to_sensor(rays_window window, rays_pixel image);

/* The image's pixel at a pixel of the sensor: what rays_project gave. */
rays_pixel rays_from_sensor(rays_window window, rays_pixel sensor);

/* Whether this target computes the bits that the packing host computed. `number`, which may be null, becomes how many tests
 * there are or, with RAYS_SELF_TEST_FAILED, the first that failed, counted from 0. */
int rays_self_test(const rays_rig *rig, size_t *number);

#ifdef __cplusplus
}
#endif

#endif
