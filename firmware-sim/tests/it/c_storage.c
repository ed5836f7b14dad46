/* rays_storage of rays_device.h over a flash with the rules of real parts: an update is cut at every operation, the unit or block under way
 * half done; then the device starts again, which must find the old or the new blob, take an update, and find that. Then everything that can be done
 * wrong, which has a code of its own. Prints for each kind of flash how many cuts there were. */
#include "rays_device.h"
#include <stdio.h>
#include <string.h>

#define EXPECT(expression, value)                                                                  \
    do {                                                                                           \
        long found = (long)(expression);                                                           \
        if (found != (long)(value)) {                                                              \
            printf("line %d: %s is %ld\n", __LINE__, #expression, found);                          \
            return 1;                                                                              \
        }                                                                                          \
    } while (0)

enum { MOST = 1 << 18 };

struct chip {
    uint8_t *bytes;
    uint8_t *written; /* which bytes were programmed since they were erased */
};

static uint64_t memory[2][MOST / 8];
static uint8_t written[2][MOST];
static struct chip chips[2];
static struct {
    uint32_t unit, block, slot;
    uint8_t erased, no_erase, blank_fails;
} rules;
static long operations_left = -1; /* negative: no cut */
static long operations, steps;

/* 0: go on; 1: this operation is cut; 2: there is no power. */
static int power(void)
{
    operations++;
    if (operations_left < 0) {
        return 0;
    }
    return operations_left-- > 0 ? 0 : (operations_left = 0, 1);
}

static int read_flash(void *context, uint32_t address, void *bytes, size_t length)
{
    const struct chip *chip = context;
    if (address + length > rules.slot) {
        return -1;
    }
    for (size_t k = 0; rules.blank_fails && k < length; k++) {
        if (!chip->written[address + k]) {
            return -1;
        }
    }
    memcpy(bytes, chip->bytes + address, length);
    return 0;
}

static int program_flash(void *context, uint32_t address, const void *bytes, size_t length)
{
    struct chip *chip = context;
    if (address % rules.unit != 0 || length % rules.unit != 0 || address + length > rules.slot) {
        printf("a program of %lu bytes at %lu\n", (unsigned long)length, (unsigned long)address);
        return -1;
    }
    for (size_t unit = 0; unit < length; unit += rules.unit) {
        uint8_t *place = chip->bytes + address + unit;
        for (size_t k = 0; !rules.no_erase && k < rules.unit; k++) {
            if (chip->written[address + unit + k]) {
                printf("programmed twice at %lu\n", (unsigned long)(address + unit));
                return -1;
            }
        }
        const int is_cut = power();
        /* Cut half way: some of the unit's bits. */
        for (size_t k = 0; k < rules.unit; k++) {
            const uint8_t wanted = ((const uint8_t *)bytes)[unit + k];
            if (!is_cut) {
                place[k] = wanted;
            } else if (k % 2 == 0) {
                place[k] = (uint8_t)(place[k] ^ ((place[k] ^ wanted) & 0x55));
            }
            chip->written[address + unit + k] = 1;
        }
        if (is_cut) {
            return -1;
        }
    }
    return 0;
}

static int erase_flash(void *context, uint32_t address, uint32_t length)
{
    struct chip *chip = context;
    if (rules.no_erase || address % rules.block != 0 || length % rules.block != 0 || address + length > rules.slot) {
        printf("an erase of %lu bytes at %lu\n", (unsigned long)length, (unsigned long)address);
        return -1;
    }
    const int is_cut = power();
    const uint32_t done = is_cut ? length / 3 : length;
    memset(chip->bytes + address, rules.erased, done);
    memset(chip->written + address, 0, done);
    return is_cut ? -1 : 0;
}

static int is_blank(void *context, uint32_t address, uint32_t length)
{
    const struct chip *chip = context;
    for (uint32_t k = 0; k < length; k++) {
        if (chip->written[address + k]) {
            return 0;
        }
    }
    return 1;
}

static void step(void *context)
{
    (void)context;
    steps++;
}

static rays_storage storage;
static rays_flash slots[2];

static void new_flash(void)
{
    for (int k = 0; k < 2; k++) {
        chips[k].bytes = (uint8_t *)memory[k];
        chips[k].written = written[k];
        memset(memory[k], rules.erased, rules.slot);
        memset(written[k], 0, rules.slot);
        const rays_flash slot = {&chips[k], memory[k], rules.slot, rules.unit, rules.block, rules.erased, rules.no_erase,
                                 read_flash, program_flash, erase_flash, rules.blank_fails ? is_blank : NULL, step};
        slots[k] = slot;
    }
}

static uint64_t blobs[2][1 << 11];
static size_t lengths[2];

static int update(int which)
{
    const uint8_t *bytes = (const uint8_t *)blobs[which];
    int code = rays_storage_begin(&storage, lengths[which]);
    for (size_t done = 0; code == RAYS_OK && done < lengths[which]; done += 512) {
        const size_t rest = lengths[which] - done;
        code = rays_storage_write(&storage, bytes + done, rest < 512 ? rest : 512);
    }
    return code == RAYS_OK ? rays_storage_finish(&storage) : code;
}

/* Which blob is active: 0 or 1, or -1 for anything else. */
static int active(void)
{
    const void *blob;
    size_t length;
    if (rays_storage_blob(&storage, &blob, &length) != RAYS_OK) {
        return -1;
    }
    for (int k = 0; k < 2; k++) {
        if (length == lengths[k] && memcmp(blob, blobs[k], length) == 0) {
            return k;
        }
    }
    return -1;
}

static int every_cut(void)
{
    long cuts = 0, olds = 0;
    for (long at = 0;; at++) {
        new_flash();
        operations_left = -1;
        EXPECT(rays_storage_start(&storage, slots), RAYS_OK);
        EXPECT(active(), -1);
        EXPECT(update(1), RAYS_OK);
        EXPECT(update(0), RAYS_OK);
        EXPECT(active(), 0);
        operations_left = at;
        const int code = update(1);
        if (operations_left > 0) {
            EXPECT(code, RAYS_OK);
            EXPECT(active(), 1);
            break;
        }
        cuts++;
        /* Power is back; the same at every start. */
        operations_left = -1;
        EXPECT(rays_storage_start(&storage, slots), RAYS_OK);
        const int first = active();
        if (first < 0) {
            printf("no blob after a cut at operation %ld\n", at);
            return 1;
        }
        olds += first == 0;
        for (int k = 0; k < 3; k++) {
            EXPECT(rays_storage_start(&storage, slots), RAYS_OK);
            EXPECT(active(), first);
        }
        EXPECT(update(!first), RAYS_OK);
        EXPECT(active(), !first);
        EXPECT(rays_storage_start(&storage, slots), RAYS_OK);
        EXPECT(active(), !first);
    }
    EXPECT(olds > 0 && steps > 0, 1);
    printf("unit %u, block %u, erased %02x%s%s: cuts %ld\n", (unsigned)rules.unit, (unsigned)rules.block, rules.erased,
           rules.no_erase ? ", no erase" : "", rules.blank_fails ? ", blank words fail" : "", cuts);
    return 0;
}

static int mistakes(void)
{
    rays_flash bad[2];
    const void *blob;
    size_t length;
    rules.unit = 8;
    rules.block = 4096;
    rules.slot = 1 << 15;
    rules.erased = 0xff;
    rules.no_erase = rules.blank_fails = 0;
    operations_left = -1;
    new_flash();
    memset(&storage, 0, sizeof storage);
    EXPECT(rays_storage_blob(&storage, &blob, &length), RAYS_NOT_OPEN);
    EXPECT(rays_storage_begin(&storage, 4096), RAYS_NOT_OPEN);
    EXPECT(rays_storage_start(NULL, slots), RAYS_BAD_ARGUMENT);
    EXPECT(rays_storage_start(&storage, NULL), RAYS_BAD_ARGUMENT);
#define BAD(change)                                                                                \
    memcpy(bad, slots, sizeof bad);                                                                \
    change;                                                                                        \
    EXPECT(rays_storage_start(&storage, bad), RAYS_BAD_FLASH);                                     \
    EXPECT(rays_storage_finish(&storage), RAYS_NOT_OPEN)
    BAD(bad[0].unit = 0);
    BAD(bad[0].unit = 24);
    BAD(bad[1].unit = 1024);
    BAD(bad[1].block = 1000);
    BAD(bad[0].block = 4);
    BAD(bad[0].capacity = 4096);
    BAD(bad[0].capacity = 32767);
    BAD(bad[0].erased = 0x55);
    BAD(bad[0].mapped = NULL);
    BAD(bad[0].mapped = (const uint8_t *)memory[0] + 4);
    BAD(bad[0].read = NULL);
    BAD(bad[1].program = NULL);
    BAD(bad[1].erase = NULL);
    EXPECT(rays_storage_start(&storage, slots), RAYS_OK);
    EXPECT(rays_storage_blob(&storage, &blob, &length), RAYS_NO_BLOB);
    EXPECT(rays_storage_blob(&storage, NULL, &length), RAYS_BAD_ARGUMENT);
    EXPECT(rays_storage_max_blob(&storage, &length), RAYS_OK);
    EXPECT(length, (1 << 15) - 4096);
    EXPECT(rays_storage_rollback(&storage), RAYS_NOTHING_TO_ROLL_BACK_TO);
    EXPECT(rays_storage_write(&storage, blobs[0], 8), RAYS_NO_UPDATE);
    EXPECT(rays_storage_finish(&storage), RAYS_NO_UPDATE);
    EXPECT(rays_storage_begin(&storage, 4), RAYS_TOO_LONG);
    EXPECT(rays_storage_begin(&storage, length + 1), RAYS_TOO_LONG);
    EXPECT(rays_storage_begin(&storage, lengths[0]), RAYS_OK);
    EXPECT(rays_storage_write(&storage, blobs[0], 0), RAYS_BAD_CHUNK);
    EXPECT(rays_storage_write(&storage, blobs[0], 12), RAYS_BAD_CHUNK);
    EXPECT(rays_storage_write(&storage, NULL, 8), RAYS_BAD_ARGUMENT);
    EXPECT(rays_storage_write(&storage, blobs[0], 8), RAYS_OK);
    EXPECT(rays_storage_finish(&storage), RAYS_INCOMPLETE);
    EXPECT(rays_storage_write(&storage, blobs[0], lengths[0]), RAYS_BAD_CHUNK);
    EXPECT(rays_storage_write(&storage, (const uint8_t *)blobs[0] + 8, lengths[0] - 8), RAYS_OK);
    EXPECT(rays_storage_finish(&storage), RAYS_OK);
    EXPECT(active(), 0);
    /* A damaged blob never becomes active. */
    ((uint8_t *)blobs[1])[100] ^= 1;
    EXPECT(update(1), RAYS_BAD_CRC);
    ((uint8_t *)blobs[1])[100] ^= 1;
    EXPECT(active(), 0);
    EXPECT(rays_storage_rollback(&storage), RAYS_NOTHING_TO_ROLL_BACK_TO);
    EXPECT(update(1), RAYS_OK);
    EXPECT(rays_storage_rollback(&storage), RAYS_OK);
    EXPECT(active(), 0);
    /* A driver that fails ends the update, and leaves the active blob. */
    operations_left = 3;
    EXPECT(update(1), RAYS_FLASH_FAILED);
    operations_left = -1;
    EXPECT(rays_storage_finish(&storage), RAYS_NO_UPDATE);
    EXPECT(active(), 0);
    /* Slots that were written for another part. */
    rules.unit = 64;
    memcpy(bad, slots, sizeof bad);
    bad[0].unit = bad[1].unit = 64;
    EXPECT(rays_storage_start(&storage, bad), RAYS_OK);
    EXPECT(rays_storage_blob(&storage, &blob, &length), RAYS_OTHER_PART);

    rays_health health;
    rays_gaps gaps;
    rays_measurement measurement;
    memset(&health, 0, sizeof health);
    memset(&measurement, 0, sizeof measurement);
    EXPECT(rays_health_start(NULL), RAYS_BAD_ARGUMENT);
    EXPECT(rays_health_note(&health, &measurement), RAYS_NOT_OPEN);
    EXPECT(rays_health_report(&health, &gaps), RAYS_NOT_OPEN);
    EXPECT(rays_health_start(&health), RAYS_OK);
    EXPECT(rays_health_note(&health, NULL), RAYS_BAD_ARGUMENT);
    EXPECT(rays_health_note(NULL, &measurement), RAYS_BAD_ARGUMENT);
    EXPECT(rays_health_report(&health, NULL), RAYS_BAD_ARGUMENT);
    EXPECT(rays_health_report(&health, &gaps), RAYS_OK);
    EXPECT(gaps.points, 0);
    measurement.gap_mm = 0.5f;
    measurement.gap_variance_mm2 = 0.01f;
    for (int k = 0; k < 200; k++) {
        EXPECT(rays_health_note(&health, &measurement), RAYS_OK);
    }
    EXPECT(rays_health_report(&health, &gaps), RAYS_OK);
    EXPECT(gaps.verdict, RAYS_GAPS_SHIFTED);
    EXPECT(gaps.points, 200);
    return 0;
}

int main(int count, char **arguments)
{
    static const struct {
        uint32_t unit, block, slot;
        uint8_t erased, no_erase, blank_fails;
    } kinds[] = {
        {1, 4096, 1 << 15, 0xff, 0, 0},     {4, 128, 1 << 15, 0x00, 0, 0},   {8, 2048, 1 << 15, 0xff, 0, 0},
        {16, 8192, 1 << 15, 0xff, 0, 0},    {32, 1 << 17, 1 << 17, 0xff, 0, 0}, {128, 8192, 1 << 15, 0xff, 0, 1},
        {256, 4096, 1 << 15, 0xff, 0, 0},   {512, 512, 1 << 16, 0xff, 0, 1}, {16, 4096, 1 << 15, 0xff, 1, 0},
    };
    for (int k = 0; k < 2; k++) {
        FILE *file = count == 3 ? fopen(arguments[1 + k], "rb") : NULL;
        if (file == NULL) {
            return 2;
        }
        lengths[k] = fread(blobs[k], 1, sizeof blobs[k], file);
        fclose(file);
    }
    for (size_t k = 0; k < sizeof kinds / sizeof kinds[0]; k++) {
        rules.unit = kinds[k].unit;
        rules.block = kinds[k].block;
        rules.slot = kinds[k].slot;
        rules.erased = kinds[k].erased;
        rules.no_erase = kinds[k].no_erase;
        rules.blank_fails = kinds[k].blank_fails;
        if (every_cut() != 0) {
            return 1;
        }
    }
    if (mistakes() != 0) {
        return 1;
    }
    puts("all as it should be");
    return 0;
}
