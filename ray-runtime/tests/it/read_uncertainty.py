"""What FORMAT.md says of the covariance of a point, from that document alone, upon the reader beside this file: whether the
self-tests of variant 2 give the stated bits. Usage: read_uncertainty.py RIG.rays; exit code 1 if a bit differs."""
import io, math, struct, sys
import read_blob
from read_blob import F, blend, cross, dot, integer, numbers, ray, sections, table, weights

class D(F):
    """An f32 with its derivatives by u and by v, found beside it."""
    def __new__(cls, value, slopes=(0, 0)):
        number = F.__new__(cls, value)
        number.slopes = tuple(map(F, slopes))
        return number
    def of(x):
        return x if isinstance(x, D) else D(x)
    def __add__(a, b):
        return D(F(a) + F(b), (x + y for x, y in zip(D.of(a).slopes, D.of(b).slopes)))
    def __mul__(a, b):
        a, b = D.of(a), D.of(b)
        return D(F(a) * F(b), (x * F(b) + F(a) * y for x, y in zip(a.slopes, b.slopes)))
    def __sub__(a, b):
        return D.__add__(a, -F(b)) if not isinstance(b, D) else D(F(a) - F(b), (x - y for x, y in zip(a.slopes, b.slopes)))
    __radd__, __rmul__ = __add__, __mul__

def spline(axes, cells, x, knot):
    """The spline, and its blends with the other weights."""
    def along(k):
        t = ((F(x[k]) - cells[k] * axes[k][3]) - cells[k] * axes[k][4]) * axes[k][2]
        r, density = 1 - t, axes[k][2]
        places = ((r * r) * r) * F(1 / 6), F(2 / 3) - (r * r) * (1 - 0.5 * r), ((t * t) * t) * F(1 / 6)
        return places, ((-0.5 * (r * r)) * density, (r * (2 - 1.5 * r)) * density, (0.5 * (t * t)) * density)
    def change(w, a, b, c, d):
        return (w[0] * (a - b) + w[1] * (c - b)) + w[2] * (d - b)
    def mean(w, a, b, c, d):
        return b + change(w, a, b, c, d)
    (wu, eu), (wv, ev) = along(0), along(1)
    window = [[F(knot(cells[0] + i, cells[1] + j)) for i in range(4)] for j in range(4)]
    rows = [mean(wu, *row) for row in window]
    return D(mean(wv, *rows), (mean(wv, *(change(eu, *row) for row in window)), change(ev, *rows)))

def slopes(t):
    """The other weights of quantized knots, at a place in its cell."""
    r = 16384 - t
    e0, e3 = 3 * (r * r >> 16), -3 * (t * t >> 16)
    return e0, 24576 - 2 * e0 + e3, -24576 + e0 - 2 * e3, e3

def small(unit, axes, places, knot):
    by_u, by_v = blend(places, knot, slopes, weights), blend(places, knot, weights, slopes)
    return D(unit * blend(places, knot), ((unit * (2 * axes[0][2])) * by_u, (unit * (2 * axes[1][2])) * by_v))
read_blob.spline, read_blob.small = spline, small

def shifts(blob, record, pixel, at):
    """How the ray moves at lambda with u and with v, mm/px."""
    found = table(blob, record, [D(pixel[0], (1, 0)), D(pixel[1], (0, 1))])
    (s1, s2, n1, n2), r = [*map(D.of, found), D(0), D(0)][:4], numbers(blob, record + 80, 9)
    values = [F(a) for a in (s1, s2, n1, n2)]
    moved = []
    for k in (0, 1):
        (a, b, m, n), (da, db, dm, dn) = values, [x.slopes[k] for x in (s1, s2, n1, n2)]
        g, p = 0.25 * (b * b - a * a), -0.5 * (a * b)
        dg, dp = 0.5 * (b * db - a * da), -0.5 * (a * db + b * da)
        across = ((dm + (g * dm + p * dn)) + (dg * m + dp * n), (dn + (p * dm - g * dn)) + (dp * m - dg * n),
                  -(a * dm + b * dn) - (da * m + db * n))
        turning = da, db, -0.5 * (a * da + b * db)
        rows = r[:3], r[3:6], r[6:]
        moved.append([dot(row, across) + at * dot(row, turning) for row in rows])
    return moved

def pair_of(blob, at, cameras):
    """Where the pair of these cameras stands, and whether it has them the other way round."""
    while True:
        first, second, nodes_u, nodes_v = struct.unpack_from("<4H", blob, at)
        if (first, second) in (cameras, cameras[::-1]):
            return at, (first, second) != cameras
        at += (32 + 11 * nodes_u * nodes_v + 7) // 8 * 8

def factor(blob, at, pixel):
    """The ten numbers of L, px."""
    nodes, number = struct.unpack_from("<2H", blob, at + 4), numbers(blob, at + 8, 6)
    q = [(pixel[k] - number[k]) * number[2 + k] for k in (0, 1)]
    i = [max(0, min(math.floor(q[k]), nodes[k] - 2)) for k in (0, 1)]
    c = [F(max(0, min(q[k] - i[k], 1))) for k in (0, 1)]
    def node(u, v):
        scale, *triangle = struct.unpack_from("<B10b", blob, at + 32 + 11 * (v * nodes[0] + u))
        return [F(scale * a) for a in triangle]
    def between(c, near, far):
        return [a + c * (b - a) for a, b in zip(near, far)]
    rows = [between(c[0], node(i[0], i[1] + j), node(i[0] + 1, i[1] + j)) for j in (0, 1)]
    return [a * number[4] for a in between(c[1], *rows)], number[5]

def sigma(blob, pairs, records, cameras, pixels, match_noise):
    rays = [ray(blob, record, pixel) for record, pixel in zip(records, pixels)]
    (o1, d1), (o2, d2) = rays
    w, n = [b - a for a, b in zip(o1, o2)], cross(d1, d2)
    k = 1 / dot(n, n)
    at = dot(cross(w, d2), n) * k, dot(cross(w, d1), n) * k
    columns = []
    for index, own, other in ((0, d1, d2), (1, d2, [-a for a in d1])):
        for a in shifts(blob, records[index], pixels[index], at[index]):
            out, along = 0.5 * dot(n, a), dot(cross(n, own), a)
            columns.append([(n[i] * out + other[i] * along) * k for i in range(3)])
    pair, is_swapped = pair_of(blob, pairs, cameras)
    j = columns[2:] + columns[:2] if is_swapped else columns
    (l11, l21, l22, l31, l32, l33, l41, l42, l43, l44), noise = factor(blob, pair, pixels[is_swapped])
    noise = noise if match_noise is None else match_noise * match_noise
    variances = []
    for i in range(3):
        a, b, c, d = (column[i] for column in j)
        c1, c2, c3, c4 = ((a * l11 + b * l21) + c * l31) + d * l41, (b * l22 + c * l32) + d * l42, c * l33 + d * l43, d * l44
        variances.append((((c1 * c1 + c2 * c2) + c3 * c3) + c4 * c4) + (((a * a + b * b) + c * c) + d * d) * noise)
    return [F(math.sqrt(a)) for a in variances]

def main(blob):
    _, version, *_, meta_len, camera_count, pair_count = struct.unpack_from("<4sHHIIIHH", blob)
    meta, first_record = io.BytesIO(blob[24:24 + meta_len]), (24 + meta_len + 7) // 8 * 8
    for _ in range(3):
        meta.read(integer(meta))
    meta.read(2 + 8)
    test_count = integer(meta)
    for _ in range(camera_count):
        meta.read(integer(meta))
        for _ in range(6):
            integer(meta)
    last = struct.unpack_from("<8I", blob, first_record + 128 * (camera_count - 1))
    pairs = (last[6] + (last[3] * last[4] + 7) // 8 + 7) // 8 * 8
    match_noise = sections(blob, pairs, pair_count, version)
    count = wrong = 0
    for _ in range(test_count):
        kind = integer(meta)
        cameras = tuple(integer(meta) for _ in range(min(kind, 1) + 1))
        pixels = [numbers(meta.read(8), 0, 2) for _ in cameras]
        stated = meta.read((24, 16, 12)[kind])
        if kind == 2:
            found = sigma(blob, pairs, [first_record + 128 * camera for camera in cameras], cameras, pixels, match_noise)
            count, wrong = count + 1, wrong + (struct.pack("<3f", *found) != stated)
    print(f"{count} uncertainties, {wrong} with other bits")
    return wrong

if __name__ == "__main__":
    sys.exit(min(1, main(open(sys.argv[1], "rb").read())))
