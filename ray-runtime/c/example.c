/* How a device uses rays.h: opens the blob at the start of a flash sector, checks itself, and measures. It prints the bits of
 * 4000 random matches, and of projections and epipolar curves of some, so that targets can be compared. `print` and `flash` are the machine's: qemu.c or host.c. */
#include "example.h"
#include "rays.h"

/* In static memory: a rig is 128 bytes. */
static rays_rig rig;

static void print_number(uint32_t number, int digits)
{
    char text[9];
    for (int k = 0; k < digits; k++) {
        text[k] = "0123456789abcdef"[number >> 4 * (digits - 1 - k) & 15];
    }
    text[digits] = 0;
    print(text);
}

static void print_bits(const float *numbers, int count)
{
    for (int k = 0; k < count; k++) {
        union { float number; uint32_t bits; } as;
        as.number = numbers[k];
        print(" ");
        print_number(as.bits, 8);
    }
}

/* A code in place of an answer, or 0 in front of one. */
static void print_code(int code)
{
    print(" | ");
    print_number((uint32_t)code, 2);
}

static uint32_t random_state = 1;

/* Pixels of a sensor of 64 x 48 and a little around it, in steps of 2^-14 px. */
static float random_px(int extent_px)
{
    random_state = random_state * 1664525u + 1013904223u;
    return (float)(int32_t)((random_state >> 8) % (uint32_t)((extent_px + 1) << 14)) / 16384.0f - 1.0f;
}

/* What the blob says of itself. */
static int print_info(void)
{
    rays_info info;
    int code = rays_info_of(&rig, &info);
    print("info");
    print_code(code);
    if (code == RAYS_OK) {
        print(" ");
        for (size_t k = 0; k < sizeof info.identity; k++) {
            print_number(info.identity[k], 2);
        }
        print_bits(&info.max_error_px, 1);
        print_bits(&info.working_distance_mm, 1);
        print(" ");
        print_number((uint32_t)info.blob_len, 8);
    }
    print(rays_version() == RAYS_VERSION ? ", header and library agree\n" : ", header and library differ\n");
    return code;
}

/* Where the second camera would see the point of a match, and where the first pixel's ray runs there. */
static void print_search(rays_sighting first, rays_sighting second, const rays_point *point)
{
    enum { STEPS = 8 };
    rays_pixel pixel, near;
    rays_curve_point curve[STEPS];
    size_t found;
    int code = rays_project(&rig, 1, point->point_mm, &pixel);
    print_code(code);
    if (code == RAYS_OK) {
        print_bits(&pixel.u_px, 1);
        print_bits(&pixel.v_px, 1);
        pixel.u_px += 2.5f;
        print_code(code = rays_project_near(&rig, 1, point->point_mm, pixel, &near));
        if (code == RAYS_OK) {
            print_bits(&near.u_px, 1);
            print_bits(&near.v_px, 1);
        }
    }
    print_code(code = rays_epipolar_curve(&rig, first, 1, 100.0f, 3000.0f, curve, STEPS, &found));
    for (size_t k = 0; code == RAYS_OK && k < found; k++) {
        print_bits(&curve[k].pixel.u_px, 1);
        print_bits(&curve[k].pixel.v_px, 1);
        print_bits(curve[k].point_mm, 3);
    }
    /* A camera may see a point twice, as it does in a mirror; here it stands for a third one. */
    const rays_sighting sightings[3] = {first, second, {1, second.u_px + 0.5f, second.v_px - 0.25f}};
    rays_point nearest;
    print_code(code = rays_triangulate_many(&rig, sightings, 3, &nearest));
    if (code == RAYS_OK) {
        print_bits(nearest.point_mm, 3);
        print_bits(&nearest.gap_squared_mm2, 1);
    }
}

/* The rows below the middle of the second camera's sensor, two by two pixels joined. */
static void print_window(void)
{
    rays_camera camera;
    rays_window window;
    int code = rays_camera_of(&rig, 1, &camera);
    if (code == RAYS_OK) {
        const uint32_t width = camera.sensor_width_px, height = camera.sensor_height_px;
        const rays_readout readout = {{width, height}, {0, height / 2}, {width / 2, height / 4}, {2, 2}};
        code = rays_window_of(&rig, 1, &readout, &window);
    }
    print("window");
    print_code(code);
    if (code == RAYS_OK) {
        const rays_pixel image = {3.25f, 7.5f};
        const rays_pixel sensor = rays_to_sensor(window, image), back = rays_from_sensor(window, sensor);
        print_bits(&sensor.u_px, 1);
        print_bits(&sensor.v_px, 1);
        print_bits(&back.u_px, 1);
        print_bits(&back.v_px, 1);
    }
    print("\n");
}

int example(void)
{
    size_t length;
    const void *sector = flash(&length);
    uint32_t blob_len;
    int code = rays_stated_len(sector, length, &blob_len);
    if (code == RAYS_OK) {
        code = rays_open(&rig, sector, blob_len <= length ? blob_len : length);
    }
    if (code != RAYS_OK) {
        print("no blob: code ");
        print_number((uint32_t)code, 2);
        print("\n");
        return 1;
    }
    size_t tests;
    code = rays_self_test(&rig, &tests);
    print("cameras ");
    print_number((uint32_t)rays_camera_count(&rig), 2);
    print(", self-tests ");
    print_number((uint32_t)tests, 2);
    print(code == RAYS_OK ? " passed\n" : " failed\n");
    if (code != RAYS_OK) {
        return 1;
    }
    if (print_info() != RAYS_OK) {
        return 1;
    }
    print_window();
    for (int k = 0; k < 4000; k++) {
        rays_sighting first = {0, 0, 0}, second = {1, 0, 0};
        first.u_px = random_px(64);
        first.v_px = random_px(48);
        second.u_px = random_px(64);
        second.v_px = random_px(48);

        rays_ray ray;
        rays_point point;
        rays_measurement measurement;
        print_code(code = rays_lookup(&rig, second, &ray));
        if (code == RAYS_OK) {
            print_bits(ray.origin_mm, 3);
            print_bits(ray.direction, 3);
        }
        print_code(code = rays_triangulate(&rig, first, second, &point));
        if (code == RAYS_OK) {
            print_bits(point.point_mm, 3);
            print_bits(&point.gap_squared_mm2, 1);
        }
        if (code == RAYS_OK && k % 32 == 0) {
            print_search(first, second, &point);
        }
        print_code(code = rays_triangulate_with_covariance(&rig, first, second, &measurement));
        if (code == RAYS_OK) {
            print_bits(measurement.point_mm, 3);
            print_bits(&measurement.gap_squared_mm2, 1);
            print_bits(measurement.sigma_mm, measurement.has_sigma ? 3 : 0);
            print_bits(&measurement.gap_mm, 1);
            print_bits(&measurement.gap_variance_mm2, 1);
        }
        if (code == RAYS_OK && k % 32 == 0) {
            print_code(code = rays_triangulate_with_noise(&rig, first, second, 0.375f, &measurement));
            print_bits(measurement.sigma_mm, measurement.has_sigma ? 3 : 0);
        }
        print("\n");
    }
    return 0;
}
