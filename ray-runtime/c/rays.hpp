/* rays.h for C++17 and later: answers that are a value or a code, spans, and a rig that owns its blob. A header alone; link with
 * librays.a as for C. What each call does, costs and refuses is said in rays.h.
 *
 * The first part needs nothing but rays.h: no standard library, no exceptions, no allocation. It is what a device includes. With
 * a hosted compiler (or RAYS_HOSTED defined as 1) the second part adds rays::loaded_rig, which owns its bytes and reads files; and where
 * exceptions are on, result::value() throws a rays::error instead of making the caller look at the code. */
#ifndef RAYS_HPP
#define RAYS_HPP

#include "rays.h"

#ifndef RAYS_HOSTED
#define RAYS_HOSTED __STDC_HOSTED__
#endif
#if defined(__cpp_exceptions) && RAYS_HOSTED
#define RAYS_EXCEPTIONS 1
#else
#define RAYS_EXCEPTIONS 0
#endif

#if RAYS_HOSTED
#include <cstdio>
#include <cstring>
#include <memory>
#include <string>
#include <utility>
#endif
#if RAYS_EXCEPTIONS
#include <stdexcept>
#endif

namespace rays {

/* The codes of rays.h; later versions may have others. */
enum class code : int {
    ok = RAYS_OK,
    truncated = RAYS_TRUNCATED,
    bad_magic = RAYS_BAD_MAGIC,
    wrong_version = RAYS_WRONG_VERSION,
    trailing_bytes = RAYS_TRAILING_BYTES,
    bad_crc = RAYS_BAD_CRC,
    misaligned = RAYS_MISALIGNED,
    bad_header = RAYS_BAD_HEADER,
    bad_meta = RAYS_BAD_META,
    bad_padding = RAYS_BAD_PADDING,
    unknown_encoding = RAYS_UNKNOWN_ENCODING,
    bad_layout = RAYS_BAD_LAYOUT,
    bad_number = RAYS_BAD_NUMBER,
    bad_pair = RAYS_BAD_PAIR,
    bad_section = RAYS_BAD_SECTION,
    unknown_section = RAYS_UNKNOWN_SECTION,
    wrong_rounding = RAYS_WRONG_ROUNDING,
    outside = RAYS_OUTSIDE,
    no_such_camera = RAYS_NO_SUCH_CAMERA,
    too_few_rays = RAYS_TOO_FEW_RAYS,
    parallel = RAYS_PARALLEL,
    behind = RAYS_BEHIND,
    unseen = RAYS_UNSEEN,
    wrong_sensor = RAYS_WRONG_SENSOR,
    not_on_sensor = RAYS_NOT_ON_SENSOR,
    bad_argument = RAYS_BAD_ARGUMENT,
    not_open = RAYS_NOT_OPEN,
    self_test_failed = RAYS_SELF_TEST_FAILED,
    /* Of this header: the file cannot be read. */
    cannot_read = 256
};

/* A code in words. */
inline const char *words(code found) noexcept
{
    switch (found) {
    case code::ok: return "ok";
    case code::truncated: return "fewer bytes than the blob says it has";
    case code::bad_magic: return "no blob";
    case code::wrong_version: return "a blob of a version that this library does not read";
    case code::trailing_bytes: return "more bytes than the blob says it has";
    case code::bad_crc: return "the blob was damaged on the way";
    case code::misaligned: return "the blob is not at a multiple of 8";
    case code::bad_header:
    case code::bad_meta:
    case code::bad_padding:
    case code::unknown_encoding:
    case code::bad_layout:
    case code::bad_number:
    case code::bad_pair:
    case code::bad_section: return "the blob is not what its format says";
    case code::unknown_section: return "the blob says what must be understood, and this library does not";
    case code::wrong_rounding: return "the processor does not round to nearest; nothing is wrong with the blob";
    case code::outside: return "a pixel outside of the calibrated area";
    case code::no_such_camera: return "no such camera";
    case code::too_few_rays: return "fewer than two sightings";
    case code::parallel: return "the rays are parallel";
    case code::behind: return "the rays meet behind a camera";
    case code::unseen: return "no calibrated pixel sees the point";
    case code::wrong_sensor: return "calibrated on a sensor of another size";
    case code::not_on_sensor: return "not on the sensor";
    case code::bad_argument: return "an argument that there is not";
    case code::not_open: return "the rig is not open";
    case code::self_test_failed: return "this machine computes other bits";
    case code::cannot_read: return "the file cannot be read";
    }
    return "a code of a later version";
}

#if RAYS_EXCEPTIONS
/* An answer that was asked for with result::value() and that there is not. */
class error : public std::runtime_error {
public:
    explicit error(rays::code why) : std::runtime_error(words(why)), why_(why) {}
    rays::code code() const noexcept { return why_; }

private:
    rays::code why_;
};
#endif

/* An answer, or the code that says why there is none. */
template <class T>
class result {
public:
    constexpr result(const T &value) noexcept : value_(value), code_(rays::code::ok) {}
    constexpr result(rays::code why) noexcept : value_{}, code_(why) {}

    constexpr bool has_value() const noexcept { return code_ == rays::code::ok; }
    constexpr explicit operator bool() const noexcept { return has_value(); }
    constexpr rays::code code() const noexcept { return code_; }
    /* Only of an answer: all zeros otherwise. */
    constexpr const T &operator*() const noexcept { return value_; }
    constexpr const T *operator->() const noexcept { return &value_; }
    constexpr T value_or(const T &other) const noexcept { return has_value() ? value_ : other; }
#if RAYS_EXCEPTIONS
    /* The answer, or a rays::error. */
    const T &value() const
    {
        if (!has_value()) {
            throw error(code_);
        }
        return value_;
    }
#endif

private:
    T value_;
    rays::code code_;
};

namespace detail {
template <class T> struct bare { using type = T; };
template <class T> struct bare<T &> { using type = T; };
template <class T> struct bare<T &&> { using type = T; };

template <class T>
result<T> answer(int found, const T &value) noexcept
{
    return found == RAYS_OK ? result<T>(value) : result<T>(static_cast<code>(found));
}
} // namespace detail

/* Things that lie one behind the other and belong to somebody else: arrays, std::array, std::vector, std::span. */
template <class T>
class span {
public:
    constexpr span() noexcept : data_(nullptr), size_(0) {}
    constexpr span(T *data, size_t size) noexcept : data_(data), size_(size) {}
    template <size_t SIZE>
    constexpr span(T (&array)[SIZE]) noexcept : data_(array), size_(SIZE) {}
    template <class Container,
              class = decltype(static_cast<T *>(static_cast<typename detail::bare<Container>::type *>(nullptr)->data()))>
    constexpr span(Container &&container) noexcept : data_(container.data()), size_(container.size()) {}

    constexpr T *data() const noexcept { return data_; }
    constexpr size_t size() const noexcept { return size_; }
    constexpr bool empty() const noexcept { return size_ == 0; }
    constexpr T *begin() const noexcept { return data_; }
    constexpr T *end() const noexcept { return data_ + size_; }
    constexpr T &operator[](size_t at) const noexcept { return data_[at]; }

private:
    T *data_;
    size_t size_;
};

using pixel = rays_pixel;
using sighting = rays_sighting;
using ray = rays_ray;
using point = rays_point;
using measurement = rays_measurement;
using curve_point = rays_curve_point;
using readout = rays_readout;
using info = rays_info;

/* A camera of a blob. The name has no zero at its end; it lies in the blob. */
struct camera {
    span<const char> name;
    uint32_t sensor_width_px;
    uint32_t sensor_height_px;
};

/* The map between an image that was read in part or binned, and its sensor. */
class window {
public:
    constexpr window() noexcept : map_{} {}
    explicit constexpr window(const rays_window &map) noexcept : map_(map) {}
    pixel to_sensor(pixel image) const noexcept { return rays_to_sensor(map_, image); }
    pixel from_sensor(pixel sensor) const noexcept { return rays_from_sensor(map_, sensor); }

private:
    rays_window map_;
};

/* An open rig, or none yet. It borrows its blob, which stays where it is, at a multiple of 8, for as long as the rig or a copy of
 * it is used. Once open it is only read: any number of threads may use it. */
class rig {
public:
    rig() noexcept : rig_{} {}

    /* Checks the whole blob and opens it in place. */
    static result<rig> open(const void *blob, size_t length) noexcept
    {
        rig opened;
        const int found = rays_open(&opened.rig_, blob, length);
        return detail::answer(found, opened);
    }
    static result<rig> open(span<const uint8_t> blob) noexcept { return open(blob.data(), blob.size()); }

    /* The blob at the start of a longer piece of memory, such as a sector of flash. */
    static result<rig> open_first(const void *bytes, size_t length) noexcept
    {
        uint32_t stated = 0;
        const int found = rays_stated_len(bytes, length, &stated);
        if (found != RAYS_OK) {
            return static_cast<code>(found);
        }
        return open(bytes, stated <= length ? stated : length);
    }

    /* 0 if it is not open. */
    size_t camera_count() const noexcept { return rays_camera_count(&rig_); }

    result<rays::camera> camera(size_t index) const noexcept
    {
        rays_camera info = {};
        const int found = rays_camera_of(&rig_, index, &info);
        return detail::answer(found, rays::camera{{info.name, info.name_len}, info.sensor_width_px, info.sensor_height_px});
    }

    /* The calibration's identity, and what packing it cost. */
    result<rays::info> info() const noexcept
    {
        rays::info found = {};
        const int why = rays_info_of(&rig_, &found);
        return detail::answer(why, found);
    }

    result<ray> lookup(sighting at) const noexcept
    {
        ray found = {};
        const int why = rays_lookup(&rig_, at, &found);
        return detail::answer(why, found);
    }

    result<point> triangulate(sighting first, sighting second) const noexcept
    {
        point found = {};
        const int why = rays_triangulate(&rig_, first, second, &found);
        return detail::answer(why, found);
    }

    /* Of two sightings or more, by least squares. */
    result<point> triangulate_many(span<const sighting> sightings) const noexcept
    {
        point found = {};
        const int why = rays_triangulate_many(&rig_, sightings.data(), sightings.size(), &found);
        return detail::answer(why, found);
    }

    result<measurement> triangulate_with_covariance(sighting first, sighting second) const noexcept
    {
        measurement found = {};
        const int why = rays_triangulate_with_covariance(&rig_, first, second, &found);
        return detail::answer(why, found);
    }

    result<measurement> triangulate_with_noise(sighting first, sighting second, float noise_px) const noexcept
    {
        measurement found = {};
        const int why = rays_triangulate_with_noise(&rig_, first, second, noise_px, &found);
        return detail::answer(why, found);
    }

    /* How many of the matches have a point: `first` are pixels of one camera, `second` those of another that belong to them. `points`
     * and `codes` have room for one each; a point with another code than ok is left as it was. bad_argument if the lengths differ. */
    result<size_t> triangulate(size_t first_camera, span<const pixel> first, size_t second_camera, span<const pixel> second,
                               span<point> points, span<code> codes) const noexcept
    {
        const size_t count = first.size();
        if (second.size() != count || points.size() != count || codes.size() != count) {
            return code::bad_argument;
        }
        size_t found = 0;
        for (size_t k = 0; k < count; k++) {
            const sighting a = {first_camera, first[k].u_px, first[k].v_px};
            const sighting b = {second_camera, second[k].u_px, second[k].v_px};
            codes[k] = static_cast<code>(rays_triangulate(&rig_, a, b, &points[k]));
            found += codes[k] == code::ok;
        }
        return found;
    }

    /* -1 where the blob says nothing. */
    result<float> match_noise_px() const noexcept
    {
        float noise_px = 0.0f;
        const int why = rays_match_noise(&rig_, &noise_px);
        return detail::answer(why, noise_px);
    }

    result<pixel> project(size_t camera, const float (&point_mm)[3]) const noexcept
    {
        pixel found = {};
        const int why = rays_project(&rig_, camera, point_mm, &found);
        return detail::answer(why, found);
    }

    result<pixel> project_near(size_t camera, const float (&point_mm)[3], pixel start) const noexcept
    {
        pixel found = {};
        const int why = rays_project_near(&rig_, camera, point_mm, start, &found);
        return detail::answer(why, found);
    }

    /* The first of `points`, as many as the other camera sees. */
    result<span<curve_point>> epipolar_curve(sighting at, size_t other, float near_mm, float far_mm,
                                             span<curve_point> points) const noexcept
    {
        size_t found = 0;
        const int why = rays_epipolar_curve(&rig_, at, other, near_mm, far_mm, points.data(), points.size(), &found);
        return detail::answer(why, span<curve_point>(points.data(), found));
    }

    result<rays::window> window_of(size_t camera, const readout &read) const noexcept
    {
        rays_window map = {};
        const int why = rays_window_of(&rig_, camera, &read, &map);
        return detail::answer(why, rays::window(map));
    }

    /* How many tests there were, all passed. */
    result<size_t> self_test() const noexcept
    {
        size_t number = 0;
        const int why = rays_self_test(&rig_, &number);
        return detail::answer(why, number);
    }

private:
    rays_rig rig_;
};

#if RAYS_HOSTED
/* A rig that owns its blob. It can be moved and not copied; one that was moved from is not open. */
class loaded_rig {
public:
    loaded_rig() noexcept = default;
    loaded_rig(const loaded_rig &) = delete;
    loaded_rig &operator=(const loaded_rig &) = delete;
    loaded_rig(loaded_rig &&other) noexcept
        : memory_(std::move(other.memory_)), rig_(std::exchange(other.rig_, rig())), code_(std::exchange(other.code_, code::not_open))
    {
    }
    loaded_rig &operator=(loaded_rig &&other) noexcept
    {
        memory_ = std::move(other.memory_);
        rig_ = std::exchange(other.rig_, rig());
        code_ = std::exchange(other.code_, code::not_open);
        return *this;
    }

    /* Copies the blob to where it may lie. Look at code() then; nothing is thrown but for want of memory. */
    static loaded_rig from_bytes(span<const uint8_t> bytes)
    {
        loaded_rig loaded;
        loaded.memory_.reset(new uint64_t[bytes.size() / 8 + 1]);
        if (!bytes.empty()) {
            std::memcpy(loaded.memory_.get(), bytes.data(), bytes.size());
        }
        loaded.open(bytes.size());
        return loaded;
    }

    /* The same of a file. */
    static loaded_rig from_file(const char *path)
    {
        loaded_rig loaded;
        loaded.code_ = code::cannot_read;
        const std::unique_ptr<std::FILE, close_file> file(std::fopen(path, "rb"));
        if (!file) {
            return loaded;
        }
        std::string content;
        char piece[4096];
        size_t length;
        while ((length = std::fread(piece, 1, sizeof piece, file.get())) > 0) {
            content.append(piece, length);
        }
        if (std::ferror(file.get())) {
            return loaded;
        }
        return from_bytes({reinterpret_cast<const uint8_t *>(content.data()), content.size()});
    }
    static loaded_rig from_file(const std::string &path) { return from_file(path.c_str()); }

    rays::code code() const noexcept { return code_; }
    explicit operator bool() const noexcept { return code_ == rays::code::ok; }
    const rig &operator*() const noexcept { return rig_; }
    const rig *operator->() const noexcept { return &rig_; }
#if RAYS_EXCEPTIONS
    /* The rig, or a rays::error. */
    const rig &value() const
    {
        if (code_ != rays::code::ok) {
            throw error(code_);
        }
        return rig_;
    }
#endif

private:
    struct close_file {
        void operator()(std::FILE *file) const noexcept { std::fclose(file); }
    };

    void open(size_t length) noexcept
    {
        const result<rig> opened = rig::open(memory_.get(), length);
        code_ = opened.code();
        if (opened) {
            rig_ = *opened;
        }
    }

    std::unique_ptr<uint64_t[]> memory_;
    rig rig_;
    rays::code code_ = rays::code::not_open;
};
#endif

} // namespace rays

#endif
