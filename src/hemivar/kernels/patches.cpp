#include "patches.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <unordered_map>
#include <vector>

#include "pool.hpp"

namespace hemivar {

namespace {

constexpr int64_t kPiece = 64;  // patches of a piece of work
constexpr int64_t kMany = 64;   // patches of one kind whose system is solved beforehand
constexpr int kModes = 6, kBlock = 9, kDim = 3;

// Sums of `count` weighted rows of n numbers, so many side by side as registers hold.
template <int N>
void combine_by(const double* from, const double* weights, int64_t count, double* out) {
    constexpr int part = N % 12 == 0 ? 12 : N % 9 == 0 ? 9 : N % 7 == 0 ? 7 : N;
    for (int first = 0; first < N; first += part) {
        double sum[part] = {};
        for (int64_t v = 0; v < count; ++v) {
            for (int t = 0; t < part; ++t) sum[t] += weights[v] * from[v * N + first + t];
        }
        for (int t = 0; t < part; ++t) out[first + t] = sum[t];
    }
}

void combine(int64_t n, const double* from, const double* weights, int64_t count, double* out) {
    switch (n) {
        case 5: return combine_by<5>(from, weights, count, out);
        case 12: return combine_by<12>(from, weights, count, out);
        case 18: return combine_by<18>(from, weights, count, out);
        case 24: return combine_by<24>(from, weights, count, out);
        case 21: return combine_by<21>(from, weights, count, out);
        case 36: return combine_by<36>(from, weights, count, out);
    }
    for (int64_t t = 0; t < n; ++t) out[t] = 0.0;
    for (int64_t v = 0; v < count; ++v) {
        for (int64_t t = 0; t < n; ++t) out[t] += weights[v] * from[v * n + t];
    }
}

// U with U'U / diag(U) the matrix, in its place above the diagonal; false where it is not definite. Sums go along rows,
// which compilers do side by side.
bool eliminate(int64_t n, double* A) {
    for (int64_t k = 0; k < n; ++k) {
        const double* top = A + k * n;
        if (!(top[k] > 0.0) || !std::isfinite(top[k])) return false;
        for (int64_t i = k + 1; i < n; ++i) {
            const double factor = top[i] / top[k];
            double* row = A + i * n;
            for (int64_t j = i; j < n; ++j) row[j] -= factor * top[j];
        }
    }
    return true;
}

void substitute(int64_t n, const double* U, double* x) {
    for (int64_t k = 0; k < n; ++k) {
        x[k] /= U[k * n + k];
        for (int64_t i = k + 1; i < n; ++i) x[i] -= U[k * n + i] * x[k];
    }
    for (int64_t k = n - 1; k >= 0; --k) {
        double sum = 0.0;
        for (int64_t i = k + 1; i < n; ++i) sum += U[k * n + i] * x[i];
        x[k] -= sum / U[k * n + k];
    }
}

struct Sizes {
    int64_t d, l, block, corners, n, inner, whole, own, modes, v, sides;
    Sizes(const PatchBody& body, const PatchSweep& sweep)
        : d(body.dim), l(body.nodes), block(l * d), corners(d + 1), n(corners * block), inner(body.inner),
          whole(n + inner), own(d == 3 ? 3 : (l == 2 ? 1 : 3)), modes(d * (d + 1) / 2), v(modes * (modes + 1) / 2),
          sides(sweep.sides_of_seen) {}
};

// Which facets and cells a patch has, and how it hangs together.
struct Shape {
    std::vector<int64_t> cells, facets;
    std::vector<int> local;                // what each cell is seen at
    std::vector<int> place;                // of the sides of each cell among the facets; -1 for others
    std::vector<int> ends;                 // first and second cell of each facet; the number of cells for none
    std::vector<signed char> circuits;     // facets of each circuit: 1 where it leaves the first cell, -1 the second
    int64_t width = 0;
    bool priced = false;

    int64_t fields(const Sizes& z) const { return static_cast<int64_t>(facets.size()) * z.own + width * z.modes; }
};

struct Gatherer {
    const PatchBody& body;
    const PatchSweep& sweep;
    const Sizes& z;
    std::vector<int> parent, through;
    std::vector<int> queue;

    void gather(int64_t patch, Shape& out) const {
        const int64_t first = sweep.start[patch], last = sweep.start[patch + 1];
        const int count = static_cast<int>(last - first);
        out.cells.clear();
        out.facets.clear();
        out.local.clear();
        out.ends.clear();
        out.place.assign(count * z.sides, -1);
        out.priced = false;
        for (int c = 0; c < count; ++c) {
            const int64_t cell = sweep.seen[first + c] / sweep.seen_of_cell;
            const int64_t at = sweep.seen[first + c] % sweep.seen_of_cell;
            out.cells.push_back(cell);
            out.local.push_back(static_cast<int>(at));
            for (int64_t s = 0; s < z.sides; ++s) {
                const int64_t side = sweep.sides[at * z.sides + s], facet = body.cell_facets[cell * z.corners + side];
                if (!sweep.free[facet]) continue;
                size_t j = 0;
                while (j < out.facets.size() && out.facets[j] != facet) ++j;
                if (j == out.facets.size()) {
                    out.facets.push_back(facet);
                    out.ends.insert(out.ends.end(), {count, count});
                    if (sweep.rows && sweep.rows[facet] >= 0) out.priced = true;
                }
                out.place[c * z.sides + s] = static_cast<int>(j);
                out.ends[2 * j + (body.signs[cell * z.corners + side] < 0.0 ? 1 : 0)] = c;
            }
        }
    }

    // The facets, with the sign of their direction, on the way from a cell to the root of its tree, added to a row.
    void climb(const Shape& shape, int node, int sign, signed char* row) const {
        while (through[node] >= 0) {
            const int j = through[node];
            row[j] = static_cast<signed char>(row[j] + (shape.ends[2 * j] == node ? sign : -sign));
            node = parent[node];
        }
    }

    void close(Shape& shape) {
        const int cells = static_cast<int>(shape.cells.size()), facets = static_cast<int>(shape.facets.size());
        parent.assign(cells + 1, -1);
        through.assign(cells + 1, -1);
        std::vector<char> reached(cells + 1, 0), used(facets, 0);
        for (int start = cells; start >= 0; --start) {
            if (reached[start]) continue;
            reached[start] = 1;
            queue.assign(1, start);
            for (size_t at = 0; at < queue.size(); ++at) {
                for (int j = 0; j < facets; ++j) {
                    const int one = shape.ends[2 * j], two = shape.ends[2 * j + 1];
                    if (one != queue[at] && two != queue[at]) continue;
                    const int other = one == queue[at] ? two : one;
                    if (reached[other]) continue;
                    reached[other] = used[j] = 1;
                    parent[other] = queue[at];
                    through[other] = j;
                    queue.push_back(other);
                }
            }
        }
        shape.circuits.clear();
        shape.width = 0;
        for (int j = 0; j < facets; ++j) {
            if (used[j]) continue;
            shape.circuits.resize((shape.width + 1) * facets, 0);
            signed char* row = &shape.circuits[shape.width * facets];
            row[j] = 1;
            climb(shape, shape.ends[2 * j + 1], 1, row);
            climb(shape, shape.ends[2 * j], -1, row);
            ++shape.width;
        }
    }
};

// The nodes of the facets of a patch about its middle, and moments of fields on them.
struct Fields {
    const PatchBody& body;
    const Sizes& z;
    std::vector<double> x;

    void place(const Shape& shape) {
        const int64_t facets = static_cast<int64_t>(shape.facets.size());
        x.resize(facets * z.block);
        double middle[kDim] = {};
        for (int64_t j = 0; j < facets; ++j) {
            for (int64_t a = 0; a < z.l; ++a) {
                const double* from = body.points + body.facet_nodes[shape.facets[j] * z.l + a] * z.d;
                for (int64_t i = 0; i < z.d; ++i) {
                    x[j * z.block + a * z.d + i] = from[i];
                    middle[i] += from[i];
                }
            }
        }
        for (int64_t i = 0; i < z.d; ++i) middle[i] /= static_cast<double>(facets * z.l);
        for (int64_t a = 0; a < facets * z.l; ++a) {
            for (int64_t i = 0; i < z.d; ++i) x[a * z.d + i] -= middle[i];
        }
    }

    // Moments along an edge of facet j, or across it, are added to `out`.
    void add_own(int64_t j, int64_t number, double size, double* out) const {
        const double* at = &x[j * z.block];
        if (z.d == 3) {
            const int64_t one = number == 2 ? 1 : 0, two = number == 0 ? 1 : 2;
            for (int64_t i = 0; i < 3; ++i) {
                const double along = size * (at[two * 3 + i] - at[one * 3 + i]);
                out[one * 3 + i] += along;
                out[two * 3 + i] -= along;
            }
            return;
        }
        const double along[2] = {at[2] - at[0], at[3] - at[1]};
        const double way[2] = {number == 2 ? -along[1] : along[0], number == 2 ? along[0] : along[1]};
        for (int64_t i = 0; i < 2; ++i) {
            if (number == 0) {
                out[i] += size * way[i];
                out[2 + i] -= size * way[i];
            } else {
                out[i] += 0.5 * size * way[i];
                out[2 + i] += 0.5 * size * way[i];
                out[4 + i] -= size * way[i];
            }
        }
    }

    // Moments of facet j with a force and a moment about the middle of the patch are added to `out`.
    void add_flow(int64_t j, const double* flow, double* out) const {
        const double* at = &x[j * z.block];
        const double share = 1.0 / static_cast<double>(z.l);
        double middle[kDim] = {};
        for (int64_t a = 0; a < z.l; ++a) {
            for (int64_t i = 0; i < z.d; ++i) {
                middle[i] += share * at[a * z.d + i];
                out[a * z.d + i] += share * flow[i];
            }
        }
        if (z.d == 2) {
            const double left = flow[2] - (middle[0] * flow[1] - middle[1] * flow[0]);
            double square = 0.0;
            for (int64_t a = 0; a < z.l; ++a) {
                const double one = at[2 * a] - middle[0], two = at[2 * a + 1] - middle[1];
                square += one * one + two * two;
            }
            for (int64_t a = 0; a < z.l; ++a) {
                out[2 * a] -= left / square * (at[2 * a + 1] - middle[1]);
                out[2 * a + 1] += left / square * (at[2 * a] - middle[0]);
            }
            return;
        }
        double left[3], a[3], b[3], n[3], turn = 0.0, along = 0.0, across = 0.0, square = 0.0;
        for (int i = 0; i < 3; ++i) {
            const int p = (i + 1) % 3, q = (i + 2) % 3;
            left[i] = flow[3 + i] - (middle[p] * flow[q] - middle[q] * flow[p]);
            a[i] = at[3 + i] - at[i];
            b[i] = at[6 + i] - at[i];
        }
        for (int i = 0; i < 3; ++i) {
            const int p = (i + 1) % 3, q = (i + 2) % 3;
            n[i] = a[p] * b[q] - a[q] * b[p];
            square += n[i] * n[i];
        }
        for (int i = 0; i < 3; ++i) {
            n[i] /= square;
            turn += 0.5 * left[i] * n[i];
            along += left[i] * a[i];
            across += left[i] * b[i];
        }
        for (int i = 0; i < 3; ++i) {
            const double one = turn * b[i] - across * n[i], two = along * n[i] - turn * a[i];
            out[3 + i] += one;
            out[6 + i] += two;
            out[i] -= one + two;
        }
    }
};

// The misfit of a patch in its fields: those of the facets in turn, then those of the circuits.
struct System {
    std::vector<int> columns, starts;       // the fields that each cell sees, and where those of a cell begin
    // Their moments on its sides, one after the other for each moment; what they add to its slopes, field by field.
    std::vector<double> seen, bent;
    std::vector<double> H, R, b, change;
    int64_t q = 0;
};

class Improver {
public:
    Improver(const PatchBody& body, const PatchSweep& sweep)
        : body(body), sweep(sweep), z(body, sweep), gatherer{body, sweep, z, {}, {}, {}}, fields{body, z, {}} {}

    void gather(int64_t patch) { gatherer.gather(patch, shape); }

    // What makes patches of one kind: cells alike, seen at the same places, with facets in the same order.
    void key(std::vector<int64_t>& out) const {
        out.clear();
        for (size_t c = 0; c < shape.cells.size(); ++c) {
            out.push_back(body.alike[shape.cells[c]] * sweep.seen_of_cell + shape.local[c]);
            for (int64_t s = 0; s < z.sides; ++s) {
                const int j = shape.place[c * z.sides + s];
                out.push_back(j < 0 ? -1 : 2 * j + (shape.ends[2 * j] == static_cast<int>(c) ? 0 : 1));
            }
        }
    }

    void prepare(int64_t patch) {
        gather(patch);
        gatherer.close(shape);
        fields.place(shape);
        assemble();
    }

    // Improve a patch by itself.
    void improve(int64_t patch) {
        gather(patch);
        if (shape.facets.empty()) return;
        gatherer.close(shape);
        fields.place(shape);
        assemble();
        slopes(system, shape.cells);
        if (shape.priced) charge();
        if (!solve()) return;
        apply(system, shape.cells, shape.facets, shape, system.change);
    }

    // minus the inverse of the matrix, in place of R; zero where rounding decides.
    void invert() {
        const int64_t q = system.q;
        std::vector<double> unit(q, 0.0), scaled(system.H);
        for (int64_t i = 0; i < q; ++i) {
            const double own = system.H[i * q + i];
            unit[i] = own > 0.0 ? 1.0 / std::sqrt(own) : 0.0;
        }
        for (int64_t i = 0; i < q * q; ++i) scaled[i] *= unit[i / q] * unit[i % q];
        std::vector<double> inverse(q * q, 0.0), factor(scaled);
        bool good = eliminate(q, factor.data());
        for (int64_t i = 0; i < q && good; ++i) {
            inverse[i * q + i] = 1.0;
            substitute(q, factor.data(), &inverse[i * q]);
        }
        for (int64_t i = 0; i < q && good; ++i) {  // off the unit matrix by less than 1, so it lowers every misfit
            double off = 0.0;
            for (int64_t j = 0; j < q; ++j) {
                double sum = i == j ? -1.0 : 0.0;
                for (int64_t t = 0; t < q; ++t) sum += scaled[i * q + t] * inverse[j * q + t];
                off += std::abs(sum);
            }
            good = off < 1.0;
        }
        for (int64_t i = 0; i < q * q; ++i) inverse[i] = good ? -unit[i / q] * unit[i % q] * inverse[i] : 0.0;
        system.R.swap(inverse);
    }

    // Improve a patch of a kind whose system has its inverse.
    void improve_alike(int64_t patch, const Shape& kind, System& solved) {
        const int64_t first = sweep.start[patch], count = sweep.start[patch + 1] - first;
        shape.cells.resize(count);
        shape.facets.resize(kind.facets.size());
        for (int64_t c = 0; c < count; ++c) {
            shape.cells[c] = sweep.seen[first + c] / sweep.seen_of_cell;
            for (int64_t s = 0; s < z.sides; ++s) {
                const int j = kind.place[c * z.sides + s];
                if (j < 0) continue;
                const int64_t side = sweep.sides[kind.local[c] * z.sides + s];
                shape.facets[j] = body.cell_facets[shape.cells[c] * z.corners + side];
            }
        }
        slopes_of(solved, kind, shape.cells, loads);
        numbers.resize(solved.q);
        combine(solved.q, solved.R.data(), loads.data(), solved.q, numbers.data());
        fields.place(shape);
        apply(solved, shape.cells, shape.facets, kind, numbers);
    }

    Shape shape;
    System system;

private:
    // Energies of the cells in what they see of the fields.
    void assemble() {
        const int64_t cells = static_cast<int64_t>(shape.cells.size()), facets = static_cast<int64_t>(shape.facets.size());
        const int64_t rows = z.sides * z.block;
        const int64_t q = system.q = shape.fields(z);
        own.assign(facets * z.own * z.block, 0.0);
        flows.assign(shape.width ? facets * z.modes * z.block : 0, 0.0);
        for (int64_t j = 0; j < facets; ++j) {
            for (int64_t o = 0; o < z.own; ++o) fields.add_own(j, o, 1.0, &own[(j * z.own + o) * z.block]);
            for (int64_t m = 0; m < z.modes && shape.width; ++m) {
                double unit[kModes] = {};
                unit[m] = 1.0;
                fields.add_flow(j, unit, &flows[(j * z.modes + m) * z.block]);
            }
        }
        system.columns.clear();
        system.starts.assign(1, 0);
        for (int64_t c = 0; c < cells; ++c) {
            const int* place = &shape.place[c * z.sides];
            for (int64_t s = 0; s < z.sides; ++s) {
                for (int64_t o = 0; o < z.own && place[s] >= 0; ++o) {
                    system.columns.push_back(static_cast<int>(place[s] * z.own + o));
                }
            }
            for (int64_t w = 0; w < shape.width; ++w) {
                bool passes = false;
                for (int64_t s = 0; s < z.sides; ++s) {
                    passes = passes || (place[s] >= 0 && shape.circuits[w * facets + place[s]] != 0);
                }
                for (int64_t m = 0; m < z.modes && passes; ++m) {
                    system.columns.push_back(static_cast<int>(facets * z.own + w * z.modes + m));
                }
            }
            system.starts.push_back(static_cast<int>(system.columns.size()));
        }
        const int64_t total = static_cast<int64_t>(system.columns.size());
        system.seen.assign(total * rows, 0.0);
        system.bent.assign(total * z.n, 0.0);
        system.H.assign(q * q, 0.0);
        for (int64_t c = 0; c < cells; ++c) {
            see(c, facets, rows);
            bend(c, rows);
            const int first = system.starts[c], size = system.starts[c + 1] - first;
            turned.resize(size);
            local.assign(size * size, 0.0);
            for (int64_t s = 0; s < z.sides; ++s) {
                if (shape.place[c * z.sides + s] < 0) continue;
                for (int64_t t = 0; t < z.block; ++t) {
                    const int64_t n = side(shape.local[c], s) * z.block + t;
                    for (int j = 0; j < size; ++j) turned[j] = system.bent[(first + j) * z.n + n];
                    const double* seen = &system.seen[first * rows + (s * z.block + t) * size];
                    for (int i = 0; i < size; ++i) {
                        if (seen[i] == 0.0) continue;
                        double* to = &local[i * size];
                        for (int j = 0; j < size; ++j) to[j] += seen[i] * turned[j];
                    }
                }
            }
            for (int i = 0; i < size; ++i) {
                double* to = &system.H[system.columns[first + i] * q];
                for (int j = 0; j < size; ++j) to[system.columns[first + j]] += local[i * size + j];
            }
        }
    }

    int64_t side(int local, int64_t s) const { return sweep.sides[local * z.sides + s]; }

    // Moments of the fields on the sides of a cell, outward, on the reference simplex.
    void see(int64_t c, int64_t facets, int64_t rows) {
        const int64_t cell = shape.cells[c];
        const double* inverse = body.gradients + (cell * z.corners + 1) * z.d;
        for (int64_t s = 0; s < z.sides; ++s) {
            const int64_t j = shape.place[c * z.sides + s];
            if (j < 0) continue;
            const double sign = body.signs[cell * z.corners + side(shape.local[c], s)];
            const int first = system.starts[c], fields = system.starts[c + 1] - first;
            for (int i = 0; i < fields; ++i) {
                const int64_t column = system.columns[first + i], field = column - facets * z.own;
                const double* from;
                double size = sign;
                if (field < 0) {
                    if (column / z.own != j) continue;
                    from = &own[column * z.block];
                } else {
                    size *= shape.circuits[field / z.modes * facets + j];
                    if (size == 0.0) continue;
                    from = &flows[(j * z.modes + field % z.modes) * z.block];
                }
                double* to = &system.seen[first * rows + s * z.block * fields + i];
                for (int64_t a = 0; a < z.l; ++a) {
                    for (int64_t r = 0; r < z.d; ++r) {
                        double sum = 0.0;
                        for (int64_t t = 0; t < z.d; ++t) sum += inverse[r * z.d + t] * from[a * z.d + t];
                        to[(a * z.d + r) * fields] = size * sum;
                    }
                }
            }
        }
    }

    // What these moments add to the slopes of the cell, the least over what has no tractions.
    void bend(int64_t c, int64_t rows) {
        const double* weights = body.compliance + shape.cells[c] * z.v;
        const int first = system.starts[c], last = system.starts[c + 1];
        energy.resize((rows + z.inner) * z.whole);
        whole.assign((last - first) * z.whole, 0.0);
        for (int64_t s = 0; s < z.sides; ++s) {
            if (shape.place[c * z.sides + s] < 0) continue;
            for (int64_t t = 0; t < z.block; ++t) {
                const int64_t row = s * z.block + t;
                row_of_energy(side(shape.local[c], s) * z.block + t, weights, &energy[row * z.whole]);
                for (int i = 0; i < last - first; ++i) {
                    const double part = system.seen[first * rows + row * (last - first) + i];
                    if (part == 0.0) continue;
                    double* to = &whole[i * z.whole];
                    for (int64_t k = 0; k < z.whole; ++k) to[k] += part * energy[row * z.whole + k];
                }
            }
        }
        if (z.inner) {
            std::vector<double> block(z.inner * z.inner);
            for (int64_t i = 0; i < z.inner; ++i) {
                row_of_energy(z.n + i, weights, &energy[(rows + i) * z.whole]);
                for (int64_t j = 0; j < z.inner; ++j) block[i * z.inner + j] = energy[(rows + i) * z.whole + z.n + j];
            }
            if (eliminate(z.inner, block.data())) {
                for (int i = first; i < last; ++i) {
                    double* to = &whole[(i - first) * z.whole];
                    substitute(z.inner, block.data(), to + z.n);
                    for (int64_t r = 0; r < z.inner; ++r) {
                        const double part = to[z.n + r];
                        for (int64_t k = 0; k < z.n; ++k) to[k] -= part * energy[(rows + r) * z.whole + k];
                    }
                }
            }
        }
        for (int i = first; i < last; ++i) {
            std::copy_n(&whole[(i - first) * z.whole], z.n, &system.bent[i * z.n]);
        }
    }

    void row_of_energy(int64_t row, const double* weights, double* out) const {
        combine(z.whole, body.energies + row * z.v * z.whole, weights, z.v, out);
    }

    void slopes(System& of, const std::vector<int64_t>& cells) { slopes_of(of, shape, cells, of.b); }

    void slopes_of(const System& of, const Shape& kind, const std::vector<int64_t>& cells, std::vector<double>& b) {
        const int64_t rows = z.sides * z.block;
        b.assign(of.q, 0.0);
        for (size_t c = 0; c < cells.size(); ++c) {
            const int first = of.starts[c], size = of.starts[c + 1] - first;
            turned.resize(size);
            for (int64_t s = 0; s < z.sides; ++s) {
                if (kind.place[c * z.sides + s] < 0) continue;
                const double* slope = sweep.slope + cells[c] * z.n + side(kind.local[c], s) * z.block;
                combine(size, &of.seen[first * rows + s * z.block * size], slope, z.block, turned.data());
                for (int i = 0; i < size; ++i) b[of.columns[first + i]] += turned[i];
            }
        }
    }

    // Add the price of contact tractions.
    void charge() {
        const int64_t facets = static_cast<int64_t>(shape.facets.size()), q = system.q;
        std::vector<double> on(q * kBlock), priced(q * kBlock), half(kBlock);
        for (int64_t j = 0; j < facets; ++j) {
            const int64_t row = sweep.rows[shape.facets[j]];
            if (row < 0) continue;
            std::fill(on.begin(), on.end(), 0.0);
            std::copy_n(&own[j * z.own * z.block], z.own * z.block, &on[j * z.own * z.block]);
            for (int64_t w = 0; w < shape.width; ++w) {
                const double sign = shape.circuits[w * facets + j];
                for (int64_t k = 0; k < z.modes * z.block && sign != 0.0; ++k) {
                    on[(facets * z.own + w * z.modes) * z.block + k] = sign * flows[j * z.modes * z.block + k];
                }
            }
            const double* P = sweep.matrices + row * z.block * z.block;
            const double* m = sweep.moments + shape.facets[j] * z.block;
            for (int64_t r = 0; r < z.block; ++r) {
                half[r] = sweep.offsets[row * z.block + r];
                for (int64_t t = 0; t < z.block; ++t) half[r] += P[r * z.block + t] * m[t];
            }
            for (int64_t i = 0; i < q; ++i) {
                for (int64_t r = 0; r < z.block; ++r) {
                    double sum = 0.0;
                    for (int64_t t = 0; t < z.block; ++t) sum += P[r * z.block + t] * on[i * z.block + t];
                    priced[i * z.block + r] = sum;
                    system.b[i] += on[i * z.block + r] * half[r];
                }
            }
            for (int64_t i = 0; i < q; ++i) {
                for (int64_t k = 0; k < q; ++k) {
                    double sum = 0.0;
                    for (int64_t r = 0; r < z.block; ++r) sum += on[i * z.block + r] * priced[k * z.block + r];
                    system.H[i * q + k] += sum;
                }
            }
        }
    }

    // The least misfit; false where rounding decides.
    bool solve() {
        const int64_t q = system.q;
        std::vector<double>& unit = numbers;
        unit.resize(q);
        scaled.resize(q * q);
        for (int64_t i = 0; i < q; ++i) {
            if (!(system.H[i * q + i] > 0.0)) return false;
            unit[i] = 1.0 / std::sqrt(system.H[i * q + i]);
        }
        for (int64_t i = 0; i < q; ++i) {
            for (int64_t j = 0; j < q; ++j) scaled[i * q + j] = system.H[i * q + j] * unit[i] * unit[j];
        }
        if (!eliminate(q, scaled.data())) return false;
        system.change.resize(q);
        for (int64_t i = 0; i < q; ++i) system.change[i] = -unit[i] * system.b[i];
        substitute(q, scaled.data(), system.change.data());
        double value = 0.0;
        for (int64_t i = 0; i < q; ++i) system.change[i] *= unit[i];
        for (int64_t i = 0; i < q; ++i) {
            double sum = 0.0;
            for (int64_t j = 0; j < q; ++j) sum += system.H[i * q + j] * system.change[j];
            value += system.change[i] * (0.5 * sum + system.b[i]);
        }
        return value < 0.0;
    }

    // Change the slopes of the cells, and the moments of the facets, whose nodes `fields` knows.
    void apply(const System& of, const std::vector<int64_t>& cells, const std::vector<int64_t>& facets,
               const Shape& kind, const std::vector<double>& change) {
        for (size_t c = 0; c < cells.size(); ++c) {
            double* to = sweep.slope + cells[c] * z.n;
            const int first = of.starts[c], size = of.starts[c + 1] - first;
            turned.resize(size + z.n);
            for (int i = 0; i < size; ++i) turned[i] = change[of.columns[first + i]];
            combine(z.n, &of.bent[first * z.n], turned.data(), size, &turned[size]);
            for (int64_t k = 0; k < z.n; ++k) to[k] += turned[size + k];
        }
        const int64_t count = static_cast<int64_t>(facets.size());
        for (int64_t j = 0; j < count; ++j) {
            double moved[kBlock] = {}, flow[kModes] = {};
            for (int64_t o = 0; o < z.own; ++o) fields.add_own(j, o, change[j * z.own + o], moved);
            for (int64_t w = 0; w < kind.width; ++w) {
                const double sign = kind.circuits[w * count + j];
                for (int64_t m = 0; m < z.modes; ++m) flow[m] += sign * change[count * z.own + w * z.modes + m];
            }
            if (kind.width) fields.add_flow(j, flow, moved);
            double* to = sweep.moments + facets[j] * z.block;
            for (int64_t t = 0; t < z.block; ++t) to[t] += moved[t];
        }
    }

    const PatchBody& body;
    const PatchSweep& sweep;
    const Sizes z;
    Gatherer gatherer;
    Fields fields;
    std::vector<double> own, flows, energy, whole, local, turned, scaled, loads, numbers;
};

// Patches that are translates of many others, with the solved system of each kind.
struct Kinds {
    std::vector<int32_t> of;  // -1 for those that are solved by themselves
    std::vector<Shape> shapes;
    std::vector<System> systems;

    Kinds(const PatchBody& body, const PatchSweep& sweep) : of(sweep.patches, -1) {
        const int64_t all = sweep.bounds[sweep.colours], pieces = (all + kPiece - 1) / kPiece;
        std::vector<uint64_t> hash(all, 0);
        share(pieces, [&](int64_t piece) {
            Improver one(body, sweep);
            std::vector<int64_t> key;
            for (int64_t at = piece * kPiece; at < std::min(all, (piece + 1) * kPiece); ++at) {
                one.gather(sweep.order[at]);
                if (one.shape.priced || one.shape.facets.empty()) continue;
                one.key(key);
                uint64_t sum = 1;
                for (int64_t part : key) {
                    sum = (sum ^ static_cast<uint64_t>(part)) * 0x9E3779B97F4A7C15u;
                    sum ^= sum >> 29;
                }
                hash[at] = sum | 1;
            }
        });
        std::unordered_map<uint64_t, int64_t> counts;
        for (uint64_t one : hash) {
            if (one) ++counts[one];
        }
        std::unordered_map<uint64_t, int32_t> number;
        std::vector<int64_t> first;
        for (int64_t at = 0; at < all; ++at) {
            if (!hash[at] || counts[hash[at]] < kMany) continue;
            const auto found = number.emplace(hash[at], static_cast<int32_t>(first.size()));
            if (found.second) first.push_back(sweep.order[at]);
            of[sweep.order[at]] = found.first->second;
        }
        shapes.resize(first.size());
        systems.resize(first.size());
        std::vector<std::vector<int64_t>> keys(first.size());
        share(static_cast<int64_t>(first.size()), [&](int64_t kind) {
            Improver one(body, sweep);
            one.prepare(first[kind]);
            one.invert();
            one.key(keys[kind]);
            shapes[kind] = one.shape;
            systems[kind] = std::move(one.system);
        });
        share(pieces, [&](int64_t piece) {  // what has the same hash need not be alike
            Improver one(body, sweep);
            std::vector<int64_t> key;
            for (int64_t at = piece * kPiece; at < std::min(all, (piece + 1) * kPiece); ++at) {
                int32_t& kind = of[sweep.order[at]];
                if (kind < 0) continue;
                one.gather(sweep.order[at]);
                one.key(key);
                if (key != keys[kind]) kind = -1;
            }
        });
    }
};

}  // namespace

int64_t colour_patches(int64_t cells, int64_t seen_of_cell, const int64_t* patches, int64_t count,
                       const int64_t* ranked, int64_t* start, int64_t* seen, int64_t* order, int64_t* bounds) {
    constexpr int64_t words = kColours / 64;
    const int64_t all = cells * seen_of_cell;
    std::fill(start, start + count + 1, int64_t{0});
    for (int64_t k = 0; k < all; ++k) {
        if (patches[k] >= 0) ++start[patches[k] + 1];
    }
    for (int64_t p = 0; p < count; ++p) start[p + 1] += start[p];
    std::vector<int64_t> next(start, start + count);
    for (int64_t k = 0; k < all; ++k) {
        if (patches[k] >= 0) seen[next[patches[k]]++] = k;
    }
    std::vector<uint64_t> taken(cells * words, 0);
    std::vector<int32_t> colour(count, -1);
    std::fill(bounds, bounds + kColours + 1, int64_t{0});
    int64_t colours = 0;
    for (int64_t r = 0; r < count; ++r) {
        const int64_t p = ranked[r];
        if (start[p] == start[p + 1]) continue;
        for (int64_t w = 0; w < words && colour[p] < 0; ++w) {
            uint64_t beside = 0;
            for (int64_t k = start[p]; k < start[p + 1]; ++k) beside |= taken[seen[k] / seen_of_cell * words + w];
            if (beside == ~uint64_t{0}) continue;
            int bit = 0;
            while (beside >> bit & 1) ++bit;
            for (int64_t k = start[p]; k < start[p + 1]; ++k) {
                taken[seen[k] / seen_of_cell * words + w] |= uint64_t{1} << bit;
            }
            colour[p] = static_cast<int32_t>(w * 64 + bit);
        }
        if (colour[p] < 0) return -1;
        ++bounds[colour[p] + 1];
        colours = std::max<int64_t>(colours, colour[p] + 1);
    }
    for (int64_t c = 0; c < kColours; ++c) bounds[c + 1] += bounds[c];
    std::vector<int64_t> put(bounds, bounds + kColours);
    for (int64_t p = 0; p < count; ++p) {
        if (colour[p] >= 0) order[put[colour[p]]++] = p;
    }
    return colours;
}

// Patches of one colour are improved side by side: none of their cells may be in two of them.
void expect_apart(const PatchBody& body, const PatchSweep& sweep) {
    std::vector<int32_t> last(body.cells, -1);
    for (int64_t colour = 0; colour < sweep.colours; ++colour) {
        for (int64_t at = sweep.bounds[colour]; at < sweep.bounds[colour + 1]; ++at) {
            const int64_t patch = sweep.order[at];
            for (int64_t k = sweep.start[patch]; k < sweep.start[patch + 1]; ++k) {
                int32_t& seen = last[sweep.seen[k] / sweep.seen_of_cell];
                if (seen == colour) throw std::invalid_argument("two patches of a colour share a cell");
                seen = static_cast<int32_t>(colour);
            }
        }
    }
}

void improve_patches(const PatchBody& body, const PatchSweep& sweep) {
    expect_apart(body, sweep);
    Kinds kinds(body, sweep);
    for (int64_t colour = 0; colour < sweep.colours; ++colour) {
        const int64_t first = sweep.bounds[colour], last = sweep.bounds[colour + 1];
        share((last - first + kPiece - 1) / kPiece, [&](int64_t piece) {
            Improver one(body, sweep);
            const int64_t from = first + piece * kPiece;
            for (int64_t at = from; at < std::min(last, from + kPiece); ++at) {
                const int64_t patch = sweep.order[at];
                const int32_t kind = kinds.of[patch];
                if (kind < 0) {
                    one.improve(patch);
                } else {
                    one.improve_alike(patch, kinds.shapes[kind], kinds.systems[kind]);
                }
            }
        });
    }
}

}  // namespace hemivar
