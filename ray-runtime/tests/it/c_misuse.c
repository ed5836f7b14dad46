/* Everything that can be done wrong with rays.h has a code of its own, and leaves what it was to write to as it was. */
#include "rays.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static uint64_t memory[1 << 12];

#define EXPECT(expression, value)                                                                  \
    do {                                                                                           \
        long found = (long)(expression);                                                           \
        if (found != (long)(value)) {                                                              \
            printf("line %d: %s is %ld\n", __LINE__, #expression, found);                          \
            return 1;                                                                              \
        }                                                                                          \
    } while (0)

int main(int count, char **arguments)
{
    FILE *file = count == 2 ? fopen(arguments[1], "rb") : NULL;
    if (file == NULL) {
        return 2;
    }
    unsigned char *bytes = (unsigned char *)memory;
    const size_t length = fread(bytes, 1, sizeof memory, file);
    fclose(file);

    rays_rig rig;
    memset(&rig, 0, sizeof rig);
    rays_sighting first = {0, 30.0f, 20.5f}, second = {1, 33.0f, 21.0f};
    rays_ray ray;
    memset(&ray, 0x55, sizeof ray);
    const rays_ray untouched = ray;
    rays_point point;
    rays_measurement measurement;
    uint32_t stated = 7;
    size_t number = 7;

    /* Before it is open. */
    EXPECT(rays_camera_count(&rig), 0);
    EXPECT(rays_camera_count(NULL), 0);
    EXPECT(rays_lookup(&rig, first, &ray), RAYS_NOT_OPEN);
    EXPECT(rays_triangulate_many(&rig, &first, 1, &point), RAYS_NOT_OPEN);
    EXPECT(rays_self_test(&rig, &number), RAYS_NOT_OPEN);
    EXPECT(number, 7);

    /* Blobs that are none. */
    EXPECT(rays_stated_len(bytes, 23, &stated), RAYS_TRUNCATED);
    EXPECT(rays_stated_len(NULL, length, &stated), RAYS_BAD_ARGUMENT);
    EXPECT(rays_stated_len(bytes, length, NULL), RAYS_BAD_ARGUMENT);
    EXPECT(stated, 7);
    EXPECT(rays_stated_len(bytes, length, &stated), RAYS_OK);
    EXPECT(stated, length);
    EXPECT(rays_open(NULL, bytes, length), RAYS_BAD_ARGUMENT);
    EXPECT(rays_open(&rig, NULL, length), RAYS_BAD_ARGUMENT);
    EXPECT(rays_open(&rig, bytes, SIZE_MAX), RAYS_BAD_ARGUMENT);
    EXPECT(rays_open(&rig, bytes, length - 8), RAYS_TRUNCATED);
    EXPECT(rays_open(&rig, bytes, length + 8), RAYS_TRAILING_BYTES);
    EXPECT(rays_open(&rig, bytes + 4, length), RAYS_BAD_MAGIC);
    bytes[4] = 9;
    EXPECT(rays_open(&rig, bytes, length), RAYS_WRONG_VERSION);
    bytes[4] = 2;
    bytes[length / 2] ^= 1;
    EXPECT(rays_open(&rig, bytes, length), RAYS_BAD_CRC);
    bytes[length / 2] ^= 1;
    memmove(bytes + 4, bytes, length);
    EXPECT(rays_open(&rig, bytes + 4, length), RAYS_MISALIGNED);
    memmove(bytes, bytes + 4, length);
    EXPECT(rays_triangulate(&rig, first, second, &point), RAYS_NOT_OPEN);

    /* An open one. */
    EXPECT(rays_open(&rig, bytes, length), RAYS_OK);
    EXPECT(rays_camera_count(&rig), 2);
    EXPECT(rays_self_test(&rig, NULL), RAYS_OK);
    EXPECT(rays_self_test(&rig, &number), RAYS_OK);
    EXPECT(number, 10);
    EXPECT(rays_lookup(NULL, first, &ray), RAYS_BAD_ARGUMENT);
    EXPECT(rays_lookup(&rig, first, NULL), RAYS_BAD_ARGUMENT);
    first.u_px = -1.0f;
    EXPECT(rays_lookup(&rig, first, &ray), RAYS_OUTSIDE);
    EXPECT(rays_triangulate_with_covariance(&rig, first, second, &measurement), RAYS_OUTSIDE);
    first.u_px = 30.0f;
    first.camera = 2;
    EXPECT(rays_lookup(&rig, first, &ray), RAYS_NO_SUCH_CAMERA);
    first.camera = 1;
    EXPECT(rays_triangulate(&rig, second, second, &point), RAYS_PARALLEL);
    EXPECT(memcmp(&ray, &untouched, sizeof ray), 0);
    first.camera = 0;
    EXPECT(rays_triangulate_with_covariance(&rig, first, second, &measurement), RAYS_OK);
    EXPECT(measurement.has_sigma, 1);
    EXPECT(rays_triangulate_with_noise(&rig, first, second, -1.0f, &measurement), RAYS_BAD_ARGUMENT);
    EXPECT(rays_triangulate_with_noise(&rig, first, second, 0.5f, NULL), RAYS_BAD_ARGUMENT);
    EXPECT(rays_triangulate_with_noise(&rig, first, second, 0.5f, &measurement), RAYS_OK);
    float noise_px = 7.0f;
    EXPECT(rays_match_noise(&rig, NULL), RAYS_BAD_ARGUMENT);
    EXPECT(rays_match_noise(&rig, &noise_px), RAYS_OK);
    EXPECT(noise_px == -1.0f, 1);

    EXPECT(measurement.gap_variance_mm2 > 0.0f, 1);
    EXPECT(measurement.gap_mm * measurement.gap_mm > 0.999f * measurement.gap_squared_mm2, 1);

    /* Any number of sightings, and what the blob says of itself. */
    rays_sighting many[3] = {first, second, second};
    rays_point nearest;
    EXPECT(rays_triangulate_many(&rig, NULL, 2, &nearest), RAYS_BAD_ARGUMENT);
    EXPECT(rays_triangulate_many(&rig, many, SIZE_MAX / 4, &nearest), RAYS_BAD_ARGUMENT);
    EXPECT(rays_triangulate_many(&rig, many, 2, NULL), RAYS_BAD_ARGUMENT);
    EXPECT(rays_triangulate_many(&rig, many, 1, &nearest), RAYS_TOO_FEW_RAYS);
    EXPECT(rays_triangulate_many(&rig, many + 1, 2, &nearest), RAYS_PARALLEL);
    EXPECT(rays_triangulate_many(&rig, many, 3, &nearest), RAYS_OK);
    many[2].camera = 9;
    EXPECT(rays_triangulate_many(&rig, many, 3, &nearest), RAYS_NO_SUCH_CAMERA);
    EXPECT(rays_triangulate(&rig, first, second, &point), RAYS_OK);
    EXPECT(rays_triangulate_many(&rig, many, 2, &nearest), RAYS_OK);
    EXPECT(memcmp(&nearest, &point, sizeof point), 0);
    rays_info info;
    EXPECT(rays_info_of(&rig, NULL), RAYS_BAD_ARGUMENT);
    EXPECT(rays_info_of(&rig, &info), RAYS_OK);
    EXPECT(info.blob_len, length);
    EXPECT(info.max_error_px > 0.0f && info.max_error_px < 1.0f, 1);

    /* Cameras, projections, curves, windows. */
    rays_camera camera;
    EXPECT(rays_camera_of(&rig, 2, &camera), RAYS_NO_SUCH_CAMERA);
    EXPECT(rays_camera_of(&rig, 0, NULL), RAYS_BAD_ARGUMENT);
    EXPECT(rays_camera_of(&rig, 1, &camera), RAYS_OK);
    EXPECT(camera.name_len, 5);
    EXPECT(memcmp(camera.name, "right", 5), 0);
    rays_pixel pixel = {7.0f, 7.0f};
    const float behind_mm[3] = {0.0f, 0.0f, -1e6f};
    EXPECT(rays_project(&rig, 0, NULL, &pixel), RAYS_BAD_ARGUMENT);
    EXPECT(rays_project(&rig, 0, behind_mm, NULL), RAYS_BAD_ARGUMENT);
    EXPECT(rays_project(&rig, 0, behind_mm, &pixel), RAYS_UNSEEN);
    EXPECT(rays_project(&rig, 2, measurement.point_mm, &pixel), RAYS_NO_SUCH_CAMERA);
    EXPECT(pixel.u_px == 7.0f && pixel.v_px == 7.0f, 1);
    EXPECT(rays_project(&rig, 0, measurement.point_mm, &pixel), RAYS_OK);
    EXPECT(rays_project_near(&rig, 0, measurement.point_mm, pixel, &pixel), RAYS_OK);
    rays_curve_point curve[4];
    EXPECT(rays_epipolar_curve(&rig, first, 1, 100.0f, 900.0f, NULL, 4, &number), RAYS_BAD_ARGUMENT);
    EXPECT(rays_epipolar_curve(&rig, first, 1, 100.0f, 900.0f, curve, 1 << 16, &number), RAYS_BAD_ARGUMENT);
    EXPECT(rays_epipolar_curve(&rig, first, 2, 100.0f, 900.0f, curve, 4, &number), RAYS_NO_SUCH_CAMERA);
    EXPECT(rays_epipolar_curve(&rig, first, 1, -1.0f, 900.0f, curve, 4, &number), RAYS_OK);
    EXPECT(number, 0);
    rays_readout readout = {{64, 48}, {8, 0}, {56, 48}, {1, 1}};
    rays_window window;
    EXPECT(rays_window_of(&rig, 0, NULL, &window), RAYS_BAD_ARGUMENT);
    EXPECT(rays_window_of(&rig, 0, &readout, &window), RAYS_OK);
    EXPECT(rays_to_sensor(window, pixel).u_px == pixel.u_px + 8.0f, 1);
    readout.first_px[0] = 9;
    EXPECT(rays_window_of(&rig, 0, &readout, &window), RAYS_NOT_ON_SENSOR);
    readout.sensor_px[0] = 65;
    EXPECT(rays_window_of(&rig, 0, &readout, &window), RAYS_WRONG_SENSOR);

    /* A failed opening closes a rig. */
    EXPECT(rays_open(&rig, bytes, 8), RAYS_TRUNCATED);
    EXPECT(rays_lookup(&rig, first, &ray), RAYS_NOT_OPEN);
    puts("all as it should be");
    return 0;
}
