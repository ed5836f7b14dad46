"""Reads a ray blob, written from FORMAT.md alone: prints what it says and whether its self-tests of rays and of matches
give the stated bits. Usage: read_blob.py RIG.rays; exit code 1 if the blob must be refused or a bit differs."""
import functools, io, struct, sys, zlib

class F(float):  # f32: each operation is rounded to nearest (f64 has the digits to make rounding twice rounding once)
    __new__ = lambda cls, x: float.__new__(cls, struct.unpack("<f", struct.pack("<f", x))[0])
for name in "add sub mul truediv radd rsub rmul rtruediv neg".split():
    setattr(F, f"__{name}__", lambda *a, op=getattr(float, f"__{name}__"): F(op(*map(F, a))))

def require(holds, what):
    if not holds:
        raise ValueError(what)
integer = lambda meta: (byte := meta.read(1)[0]) % 128 + (128 * integer(meta) if byte > 127 else 0)
numbers = lambda data, at, count: [F(x) for x in struct.unpack_from(f"<{count}f", data, at)]
dot = lambda a, b: a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
cross = lambda a, b: [a[i] * b[j] - a[j] * b[i] for i, j in ((1, 2), (2, 0), (0, 1))]
def polynomial(rest, x, y):
    total, length = F(0), 1
    while rest:
        row, rest = functools.reduce(lambda row, coefficient: row * x + coefficient, rest[:length]), rest[length:]
        total, length = total * y + row, length + 1
    return total
def spline(axes, cells, x, knot):
    def blend(k, a, b, c, d):
        r = 1 - (t := ((x[k] - cells[k] * axes[k][3]) - cells[k] * axes[k][4]) * axes[k][2])
        w0, w2, w3 = ((r * r) * r) * F(1 / 6), F(2 / 3) - (r * r) * (1 - 0.5 * r), ((t * t) * t) * F(1 / 6)
        return b + ((w0 * (a - b) + w2 * (c - b)) + w3 * (d - b))
    return blend(1, *(blend(0, *(F(knot(cells[0] + i, cells[1] + j)) for i in range(4))) for j in range(4)))
def weights(t):  # of a place in its cell
    r, w0, w3 = 16384 - t, -(16384 - t) ** 3 >> 29, -t ** 3 >> 29
    return w0, -3 * r - 2 * w0 + w3, -3 * t - 2 * w3 + w0, w3
def blend(places, knot, along_u=weights, along_v=weights):
    (u, t), (v, s) = (divmod(place, 16384) for place in places)
    row = lambda j: sum(w * knot(u + i, v + j) for i, w in enumerate(along_u(t)))
    return F(sum(w * row(j) >> 16 for j, w in enumerate(along_v(s))))
small = lambda unit, axes, places, knot: unit * blend(places, knot)
def table(blob, record, pixel):  # s1, s2 and, if the camera is not central, n1, n2
    encoding, cells_u, cells_v, mask_u, mask_v, at, mask, _ = struct.unpack_from("<8I", blob, record)
    maps, axes = 2 - encoding % 2, [numbers(blob, record + 32 + 24 * k, 6) for k in (0, 1)]
    x = [p - axis[0] for p, axis in zip(pixel, axes)]
    require(all(0 <= a <= axis[1] - axis[0] for a, axis in zip(x, axes)), "a self-test outside of the region")
    cell = lambda k, density, count: min(int(x[k] * axes[k][density]), count - 1)
    bit, cells = cell(1, 5, mask_v) * mask_u + cell(0, 5, mask_u), (cell(0, 2, cells_u), cell(1, 2, cells_v))
    require(blob[mask + bit // 8] >> bit % 8 & 1, "a self-test at a pixel that is not calibrated")
    knots = lambda code, at, step: lambda i, j: struct.unpack_from(code, blob, at + step * (j * (cells_u + 3) + i))[0]
    if encoding <= 2:
        return [spline(axes, cells, x, knots("<f", at + 4 * k, 8 * maps)) for k in range(2 * maps)]
    if encoding <= 4:
        x, y = ((a - c * axis[3]) * axis[2] for a, c, axis in zip(x, cells, axes))
        patches = numbers(blob, at + 80 * maps * (cells[1] * cells_u + cells[0]), 20 * maps)
        return [polynomial(patches[20 * (k // 2) + k % 2:][:20:2], x, y) for k in range(2 * maps)]
    kinds, start, first = blob[at:at + 4], at + 32, at + struct.unpack_from("<I", blob, at + 4)[0]
    unit, scale, density = (numbers(blob, at + k, 2) for k in (8, 16, 24))
    places, found = [int(x[k] * density[k]) for k in (0, 1)], []
    for k, degree, size in zip(range(maps), kinds[::2], kinds[1::2]):
        rest, start = numbers(blob, start, (degree + 1) * (degree + 2)), start + 4 * (degree + 1) * (degree + 2)
        for c in (0, 1):
            found.append(polynomial(rest[c::2], x[0] * scale[0] - 1, x[1] * scale[1] - 1))
            if size > 0:
                found[-1] += small(unit[k], axes, places, knots(("<b", "<h")[size - 1], first + size * c, 2 * size))
        first = aligned(first + 2 * size * (cells_u + 3) * (cells_v + 3))
    return found
def ray(blob, record, pixel):
    (s1, s2, *n), pose = table(blob, record, pixel), numbers(blob, record + 80, 12)
    r, t, h = (pose[:3], pose[3:6], pose[6:9]), pose[9:], 0.25 * (s1 * s1 + s2 * s2)
    direction = [row[2] + ((row[0] * s1 + row[1] * s2) - row[2] * h) for row in r]
    if n:
        (n1, n2), g, p = n, 0.25 * (s2 * s2 - s1 * s1), -0.5 * (s1 * s2)
        across = n1 + (g * n1 + p * n2), n2 + (p * n1 - g * n2), -(s1 * n1 + s2 * n2)
        t = [a + dot(row, across) for a, row in zip(t, r)]
    return t, direction
def match(o1, d1, o2, d2):
    w, k = [b - a for a, b in zip(o1, o2)], 1 / dot(n := cross(d1, d2), n)
    l1, l2 = dot(cross(w, d2), n) * k, dot(cross(w, d1), n) * k
    return *(((a + b * l1) + (c + d * l2)) * 0.5 for a, b, c, d in zip(o1, d1, o2, d2)), dot(w, n) * dot(w, n) * k
def aligned(at):
    return (at + 7) // 8 * 8
def sections(blob, at, pairs, version):  # what is known of those behind the pairs: how noisy matches are, px
    for _ in range(pairs):
        nodes_u, nodes_v = struct.unpack_from("<2H", blob, at + 4)
        at = aligned(at + 32 + 11 * nodes_u * nodes_v)
    found, last, count = None, 0, 0
    require(version > 3 or at == len(blob), "bytes behind the pairs")
    while at < len(blob):
        tag, flags, length = struct.unpack_from("<HHI", blob, at)
        start, at, count = at + 8, aligned(at + 8 + length), count + 1
        require(last < tag and flags <= 1 and at <= len(blob) and count <= 64, "a section that is not in order")
        require(not any(blob[start + length:at]), "padding that is not zero")
        require(tag == 1 or flags == 0, f"a section {tag} that must be understood")
        if tag == 1:
            require(length == 4 and ((found := numbers(blob, start, 1)[0]) == 0 or 1e-6 <= found <= 1e3), "no noise")
        last = tag
    return found

def main(blob):
    magic, version, *lengths, crc, meta_len, cameras, pairs = struct.unpack_from("<4sHHIIIHH", blob)
    require(magic == b"RAYS" and 1 <= version <= 4, "no blob of version 1 to 4")
    require(lengths == [24, len(blob)] and crc == zlib.crc32(blob[16:], zlib.crc32(blob[:12])), "damaged")
    meta, first_record, kinds, wrong = io.BytesIO(blob[24:24 + meta_len]), aligned(24 + meta_len), [0, 0, 0], 0
    print(version, pairs, *(meta.read(integer(meta)) for _ in range(3)), integer(meta), integer(meta))
    print(*numbers(meta.read(8), 0, 2), test_count := integer(meta))
    for at in range(first_record, first_record + 128 * cameras, 128):
        fields = struct.unpack_from("<7I", blob, at)
        print(meta.read(integer(meta)), [integer(meta) for _ in range(6)], fields)
    print("noise", sections(blob, aligned(fields[6] + (fields[3] * fields[4] + 7) // 8), pairs, version))
    for kind in (integer(meta) for _ in range(test_count)):
        records, kinds[kind] = [first_record + 128 * integer(meta) for _ in range(min(kind, 1) + 1)], kinds[kind] + 1
        rays = [a for record in records for a in ray(blob, record, numbers(meta.read(8), 0, 2))]
        stated = meta.read((24, 16, 12)[kind])
        computed = (lambda: rays[0] + rays[1], lambda: match(*rays), lambda: numbers(stated, 0, 3))[kind]()
        wrong += stated != struct.pack(f"<{len(computed)}f", *computed)
    require(not meta.read(), "metadata that end late")
    print(f"{kinds[0]} rays and {kinds[1]} matches, {wrong} with other bits")
    return wrong

if __name__ == "__main__":
    try:
        sys.exit(min(1, main(open(sys.argv[1], "rb").read())))
    except (ValueError, IndexError, ArithmeticError, struct.error) as reason:
        sys.exit(f"refused: {reason}")
