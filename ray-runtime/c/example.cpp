/* The example of rays.hpp on a workstation: example BLOB prints what example.c prints, by the C++ interface. */
#include "rays.hpp"
#include <array>
#include <cstdio>
#include <cstring>
#include <vector>

namespace {

void print_bits(rays::span<const float> numbers)
{
    for (const float number : numbers) {
        uint32_t bits;
        std::memcpy(&bits, &number, sizeof bits);
        std::printf(" %08x", static_cast<unsigned>(bits));
    }
}

void print_pixel(rays::pixel pixel)
{
    const float numbers[] = {pixel.u_px, pixel.v_px};
    print_bits(numbers);
}

/* A code in place of an answer, or 0 in front of one. */
template <class T>
bool print_code(const rays::result<T> &found)
{
    std::printf(" | %02x", static_cast<unsigned>(found.code()));
    return found.has_value();
}

/* Pixels of a sensor of 64 x 48 and a little around it, in steps of 2^-14 px. */
class random_pixels {
public:
    rays::pixel next()
    {
        const float u_px = next_px(64);
        return {u_px, next_px(48)};
    }

private:
    float next_px(uint32_t extent_px)
    {
        state_ = state_ * 1664525u + 1013904223u;
        return static_cast<float>((state_ >> 8) % ((extent_px + 1) << 14)) / 16384.0f - 1.0f;
    }

    uint32_t state_ = 1;
};

/* Where the second camera would see the point of a match, and where the first pixel's ray runs there. */
void print_search(const rays::rig &rig, rays::sighting first, rays::sighting second, const rays::point &point)
{
    const auto pixel = rig.project(1, point.point_mm);
    if (print_code(pixel)) {
        print_pixel(*pixel);
        const auto near = rig.project_near(1, point.point_mm, {pixel->u_px + 2.5f, pixel->v_px});
        if (print_code(near)) {
            print_pixel(*near);
        }
    }
    std::array<rays::curve_point, 8> room;
    const auto curve = rig.epipolar_curve(first, 1, 100.0f, 3000.0f, room);
    if (print_code(curve)) {
        for (const rays::curve_point &at : *curve) {
            print_pixel(at.pixel);
            print_bits(at.point_mm);
        }
    }
    const rays::sighting sightings[] = {first, second, {1, second.u_px + 0.5f, second.v_px - 0.25f}};
    const auto nearest = rig.triangulate_many(sightings);
    if (print_code(nearest)) {
        print_bits(nearest->point_mm);
        print_bits({&nearest->gap_squared_mm2, 1});
    }
}

/* What the blob says of itself. */
void print_info(const rays::rig &rig)
{
    const auto info = rig.info();
    std::printf("info");
    if (print_code(info)) {
        std::printf(" ");
        for (const uint8_t byte : info->identity) {
            std::printf("%02x", static_cast<unsigned>(byte));
        }
        const float numbers[] = {info->max_error_px, info->working_distance_mm};
        print_bits(numbers);
        std::printf(" %08x", static_cast<unsigned>(info->blob_len));
    }
    std::printf(", header and library %s\n", rays_version() == RAYS_VERSION ? "agree" : "differ");
}

/* The rows below the middle of the second camera's sensor, two by two pixels joined. */
void print_window(const rays::rig &rig)
{
    rays::readout readout = {};
    if (const auto camera = rig.camera(1)) {
        const uint32_t width = camera->sensor_width_px, height = camera->sensor_height_px;
        readout = {{width, height}, {0, height / 2}, {width / 2, height / 4}, {2, 2}};
    }
    const auto window = rig.window_of(1, readout);
    std::printf("window");
    if (print_code(window)) {
        const rays::pixel sensor = window->to_sensor({3.25f, 7.5f});
        print_pixel(sensor);
        print_pixel(window->from_sensor(sensor));
    }
    std::printf("\n");
}

/* All matches at once: the same points again. */
bool same_at_once(const rays::rig &rig, const std::vector<rays::pixel> &first, const std::vector<rays::pixel> &second)
{
    std::vector<rays::point> points(first.size());
    std::vector<rays::code> codes(first.size());
    const auto count = rig.triangulate(0, first, 1, second, points, codes);
    size_t found = 0;
    for (size_t k = 0; k < first.size(); k++) {
        const auto one = rig.triangulate({0, first[k].u_px, first[k].v_px}, {1, second[k].u_px, second[k].v_px});
        if (one.code() != codes[k] || (one && std::memcmp(&*one, &points[k], sizeof points[k]) != 0)) {
            return false;
        }
        found += one.has_value();
    }
    return count && *count == found;
}

} // namespace

int main(int count, char **arguments)
{
    if (count != 2) {
        std::fprintf(stderr, "usage: example BLOB\n");
        return 2;
    }
    const rays::loaded_rig loaded = rays::loaded_rig::from_file(arguments[1]);
    if (!loaded) {
        std::fprintf(stderr, "%s: %s\n", arguments[1], rays::words(loaded.code()));
        return 1;
    }
    const rays::rig &rig = *loaded;
    const auto tests = rig.self_test();
    std::printf("cameras %02x, self-tests %02x %s\n", static_cast<unsigned>(rig.camera_count()),
                static_cast<unsigned>(tests.value_or(0)), tests ? "passed" : "failed");
    print_info(rig);
    print_window(rig);
    random_pixels pixels;
    std::vector<rays::pixel> firsts, seconds;
    for (int k = 0; k < 4000; k++) {
        firsts.push_back(pixels.next());
        seconds.push_back(pixels.next());
        const rays::sighting first = {0, firsts.back().u_px, firsts.back().v_px};
        const rays::sighting second = {1, seconds.back().u_px, seconds.back().v_px};

        const auto ray = rig.lookup(second);
        if (print_code(ray)) {
            print_bits(ray->origin_mm);
            print_bits(ray->direction);
        }
        const auto point = rig.triangulate(first, second);
        if (print_code(point)) {
            print_bits(point->point_mm);
            print_bits({&point->gap_squared_mm2, 1});
            if (k % 32 == 0) {
                print_search(rig, first, second, *point);
            }
        }
        const auto measured = rig.triangulate_with_covariance(first, second);
        if (print_code(measured)) {
            print_bits(measured->point_mm);
            print_bits({&measured->gap_squared_mm2, 1});
            print_bits({measured->sigma_mm, measured->has_sigma ? 3u : 0u});
            const float gap[] = {measured->gap_mm, measured->gap_variance_mm2};
            print_bits(gap);
            if (k % 32 == 0) {
                const auto noisy = rig.triangulate_with_noise(first, second, 0.375f);
                if (print_code(noisy)) {
                    print_bits({noisy->sigma_mm, noisy->has_sigma ? 3u : 0u});
                }
            }
        }
        std::printf("\n");
    }
    return same_at_once(rig, firsts, seconds) ? 0 : 1;
}
