/* What rays.hpp adds to rays.h: who owns what, what an answer that there is not looks like, and exceptions where they are on. */
#include "rays.hpp"
#include <cstdio>
#include <type_traits>
#include <vector>
#if __cplusplus >= 202002L
#include <span>
#endif

#define EXPECT(expression)                                                                         \
    do {                                                                                           \
        if (!(expression)) {                                                                       \
            std::printf("line %d: not %s\n", __LINE__, #expression);                               \
            return 1;                                                                              \
        }                                                                                          \
    } while (0)

static_assert(!std::is_copy_constructible<rays::loaded_rig>::value, "two owners of one blob");
static_assert(std::is_nothrow_move_constructible<rays::loaded_rig>::value, "vectors of rigs copy otherwise");
static_assert(sizeof(rays::rig) == sizeof(rays_rig), "a rig is no larger than in C");

static std::vector<uint8_t> bytes_of(const char *path)
{
    std::vector<uint8_t> bytes;
    std::FILE *file = std::fopen(path, "rb");
    for (int byte; file != nullptr && (byte = std::fgetc(file)) != EOF;) {
        bytes.push_back(static_cast<uint8_t>(byte));
    }
    if (file != nullptr) {
        std::fclose(file);
    }
    return bytes;
}

int main(int count, char **arguments)
{
    using rays::code;
    if (count != 2) {
        return 2;
    }
    const rays::sighting first = {0, 30.0f, 20.5f}, second = {1, 33.0f, 21.0f};

    /* None. */
    EXPECT(rays::rig().camera_count() == 0);
    EXPECT(rays::rig().lookup(first).code() == code::not_open);
    EXPECT(rays::loaded_rig().code() == code::not_open);
    EXPECT(rays::loaded_rig::from_file("/no/such/file").code() == code::cannot_read);
    EXPECT(rays::loaded_rig::from_bytes({}).code() == code::truncated);

    /* Damaged. */
    std::vector<uint8_t> bytes = bytes_of(arguments[1]);
    bytes[bytes.size() / 2] ^= 1;
    EXPECT(rays::loaded_rig::from_bytes(bytes).code() == code::bad_crc);
    bytes[bytes.size() / 2] ^= 1;
    bytes.push_back(0);
    EXPECT(rays::loaded_rig::from_bytes(bytes).code() == code::trailing_bytes);
    /* From any address, and of a longer piece of memory the blob at its start. */
    bytes.insert(bytes.begin(), 0);
    const rays::span<const uint8_t> shifted(bytes.data() + 1, bytes.size() - 2);
    rays::loaded_rig loaded = rays::loaded_rig::from_bytes(shifted);
    EXPECT(loaded);
    std::vector<uint64_t> sector(bytes.size() / 8 + 100);
    std::memcpy(sector.data(), shifted.data(), shifted.size());
    const auto borrowed = rays::rig::open_first(sector.data(), sector.size() * 8);
    EXPECT(borrowed && borrowed->camera_count() == 2);
    EXPECT(rays::rig::open_first(sector.data(), 16).code() == code::truncated);
    EXPECT(rays::rig::open(nullptr, 8).code() == code::bad_argument);

    /* Moved: the new one answers, the old one is not open. */
    rays::loaded_rig moved = std::move(loaded);
    EXPECT(loaded.code() == code::not_open && loaded->camera_count() == 0);
    EXPECT(moved && moved->camera_count() == 2);
    loaded = std::move(moved);
    EXPECT(loaded && moved.code() == code::not_open);
    const rays::rig &rig = *loaded;
    const auto point = rig.triangulate(first, second);
    EXPECT(point && std::memcmp(&*point, &*borrowed->triangulate(first, second), sizeof *point) == 0);

    /* Answers that there are not. */
    EXPECT(rig.lookup({0, -1.0f, 20.0f}).code() == code::outside);
    EXPECT(rig.lookup({2, 30.0f, 20.0f}).code() == code::no_such_camera);
    EXPECT(rig.triangulate(second, second).code() == code::parallel);
    EXPECT(rig.project(0, {0.0f, 0.0f, -1e6f}).code() == code::unseen);
    EXPECT(rig.camera(2).code() == code::no_such_camera);
    EXPECT(rig.triangulate_with_noise(first, second, -1.0f).code() == code::bad_argument);
    EXPECT(rig.match_noise_px().value_or(7.0f) == -1.0f);
    const auto camera = rig.camera(1);
    EXPECT(camera && camera->name.size() == 5 && std::memcmp(camera->name.data(), "right", 5) == 0);
    EXPECT(rig.window_of(0, {{65, 48}, {0, 0}, {65, 48}, {1, 1}}).code() == code::wrong_sensor);
    const rays::pixel none = rig.project(0, {0.0f, 0.0f, -1e6f}).value_or({-1.0f, -1.0f});
    EXPECT(none.u_px == -1.0f);

    /* Many at once: as long as each other. */
    const rays::pixel firsts[] = {{30.0f, 20.5f}, {-1.0f, 0.0f}}, seconds[] = {{33.0f, 21.0f}, {33.0f, 21.0f}};
    rays::point points[2] = {};
    code codes[2];
    EXPECT(rig.triangulate(0, firsts, 1, seconds, points, {codes, 1}).code() == code::bad_argument);
    EXPECT(*rig.triangulate(0, firsts, 1, seconds, points, codes) == 1);
    EXPECT(codes[0] == code::ok && codes[1] == code::outside);
    EXPECT(std::memcmp(&points[0], &*point, sizeof *point) == 0);
    EXPECT(*rig.triangulate(0, {}, 1, {}, {}, {}) == 0);
#if __cplusplus >= 202002L
    EXPECT(*rig.triangulate(0, std::span(firsts), 1, std::span(seconds), std::span(points), std::span(codes)) == 1);
#endif

#if RAYS_EXCEPTIONS
    EXPECT(rig.triangulate(first, second).value().point_mm[2] == point->point_mm[2]);
    try {
        rig.triangulate(second, second).value();
        EXPECT(false);
    } catch (const rays::error &error) {
        EXPECT(error.code() == code::parallel && std::strcmp(error.what(), "the rays are parallel") == 0);
    }
    try {
        rays::loaded_rig::from_file("/no/such/file").value();
        EXPECT(false);
    } catch (const std::runtime_error &) {
    }
#endif
    std::puts("all as it should be");
    return 0;
}
