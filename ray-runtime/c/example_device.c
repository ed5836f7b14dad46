/* How a device uses rays_device.h: keeps its blob in two slots of flash, replaces it, goes back, and watches by its own measurements
 * whether the calibration still fits. The flash is an array with the rules of one; `print` and `flash` (where the blob comes from) are the
 * machine's: qemu.c or host.c. */
#include "example.h"
#include "rays_device.h"

/* Blocks of a slot: one for its log, three for its blob. */
enum { UNIT = 32, BLOCK = 4096, BLOCKS = 4 };

/* In words of 8 bytes: a slot can be read like memory, from a multiple of 8. */
static uint64_t memory[2][BLOCKS * BLOCK / 8];

static int read_flash(void *context, uint32_t address, void *bytes, size_t length)
{
    const uint8_t *from = (const uint8_t *)context + address;
    uint8_t *to = bytes;
    for (size_t k = 0; k < length; k++) {
        to[k] = from[k];
    }
    return 0;
}

/* Refuses what a chip would: part of a unit, or a unit that is not blank. */
static int program_flash(void *context, uint32_t address, const void *bytes, size_t length)
{
    uint8_t *to = (uint8_t *)context + address;
    const uint8_t *from = bytes;
    if (address % UNIT != 0 || length % UNIT != 0) {
        return -1;
    }
    for (size_t k = 0; k < length; k++) {
        if (to[k] != 0xff) {
            return -1;
        }
        to[k] = from[k];
    }
    return 0;
}

static int erase_flash(void *context, uint32_t address, uint32_t length)
{
    uint8_t *bytes = (uint8_t *)context + address;
    if (address % BLOCK != 0 || length % BLOCK != 0) {
        return -1;
    }
    for (uint32_t k = 0; k < length; k++) {
        bytes[k] = 0xff;
    }
    return 0;
}

static rays_storage storage;
static rays_health health;
static rays_rig rig;

static void print_number(uint32_t number)
{
    char text[10];
    for (int k = 0; k < 8; k++) {
        text[k] = "0123456789abcdef"[number >> 4 * (7 - k) & 15];
    }
    text[8] = ' ';
    text[9] = 0;
    print(text);
}

static void print_bits(float number)
{
    union { float number; uint32_t bits; } as;
    as.number = number;
    print_number(as.bits);
}

/* As after a restart: the code of the active blob, its length, and whether it is this one. */
static void print_active(const char *when, const void *wanted)
{
    rays_flash slots[2];
    const void *blob = NULL;
    size_t length = 0;
    for (int k = 0; k < 2; k++) {
        const rays_flash slot = {memory[k], memory[k], BLOCKS * BLOCK, UNIT, BLOCK, 0xff, 0, read_flash, program_flash, erase_flash,
                                 NULL, NULL};
        slots[k] = slot;
    }
    int code = rays_storage_start(&storage, slots);
    if (code == RAYS_OK) {
        code = rays_storage_blob(&storage, &blob, &length);
    }
    print(when);
    print_number((uint32_t)code);
    print_number((uint32_t)length);
    int is_same = code == RAYS_OK;
    for (size_t k = 0; k < length; k++) {
        is_same = is_same && ((const uint8_t *)blob)[k] == ((const uint8_t *)wanted)[k];
    }
    print(is_same ? "wanted " : "");
    print(blob == NULL ? "nowhere\n" : (const uint64_t *)blob < memory[1] ? "in slot 0\n" : "in slot 1\n");
}

/* Sends a blob in pieces, as a link would. */
static int update(const void *blob, size_t length)
{
    int code = rays_storage_begin(&storage, length);
    for (size_t done = 0; code == RAYS_OK && done < length;) {
        const size_t piece = length - done < 512 ? length - done : 512;
        code = rays_storage_write(&storage, (const uint8_t *)blob + done, piece);
        done += piece;
    }
    return code == RAYS_OK ? rays_storage_finish(&storage) : code;
}

static uint32_t random_state = 1;

static float random_px(int extent_px)
{
    random_state = random_state * 1664525u + 1013904223u;
    return (float)(int32_t)((random_state >> 8) % (uint32_t)((extent_px + 1) << 14)) / 16384.0f - 1.0f;
}

static void watch(void)
{
    rays_health_start(&health);
    for (int k = 0; k < 4000; k++) {
        rays_sighting first = {0, 0, 0}, second = {1, 0, 0};
        rays_measurement measurement;
        first.u_px = random_px(64);
        first.v_px = random_px(48);
        second.u_px = random_px(64);
        second.v_px = random_px(48);
        if (rays_triangulate_with_covariance(&rig, first, second, &measurement) == RAYS_OK) {
            rays_health_note(&health, &measurement);
        }
    }
    rays_gaps gaps;
    rays_health_report(&health, &gaps);
    print("gaps ");
    print_number((uint32_t)gaps.verdict);
    print_number(gaps.points);
    print_bits(gaps.mean_signed_mm);
    print_bits(gaps.mean_size_mm);
    print_bits(gaps.within_95_mm);
    print_number(gaps.predicted_points);
    print_bits(gaps.mean_sigma_mm);
    print_bits(gaps.shift);
    print_bits(gaps.spread);
    print("\n");
}

int example(void)
{
    size_t length;
    uint32_t blob_len;
    const void *sector = flash(&length);
    if (rays_stated_len(sector, length, &blob_len) != RAYS_OK) {
        return 1;
    }
    for (int k = 0; k < 2; k++) {
        erase_flash(memory[k], 0, BLOCKS * BLOCK);
    }
    print_active("blank: ", sector);
    for (int k = 0; k < 3; k++) {
        const int code = update(sector, blob_len);
        print("update: ");
        print_number((uint32_t)code);
        print("\n");
        print_active("restart: ", sector);
    }
    for (int k = 0; k < 2; k++) {
        print("rollback: ");
        print_number((uint32_t)rays_storage_rollback(&storage));
        print("\n");
        print_active("restart: ", sector);
    }
    const void *blob;
    if (rays_storage_blob(&storage, &blob, &length) != RAYS_OK || rays_open(&rig, blob, length) != RAYS_OK) {
        return 1;
    }
    watch();
    return 0;
}
