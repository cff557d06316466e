// The compiled kernels by themselves, for the sanitizers of a compiler: a square by bilinear levels, two unknowns a node;
// matrices of a square of triangles and of a cube of tetrahedra; patches and stars of squares and cubes cut into
// simplices.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <map>
#include <thread>
#include <vector>

#include "active_sets.hpp"
#include "cells.hpp"
#include "laws.hpp"
#include "levels.hpp"
#include "mesh_sums.hpp"
#include "panels.hpp"
#include "patches.hpp"
#include "pool.hpp"
#include "stars.hpp"

using namespace hemivar;

namespace {

struct Matrix {
    std::vector<int32_t> indptr{0}, indices;
    std::vector<double> data;
    int64_t columns = 0;
    void end_row() { indptr.push_back(static_cast<int32_t>(indices.size())); }
    void add(int64_t column, double value) {
        indices.push_back(static_cast<int32_t>(column));
        data.push_back(value);
    }
    Csr csr() const {
        return {static_cast<int64_t>(indptr.size()) - 1, columns, indptr.data(), indices.data(), data.data()};
    }
};

// Minus the Laplacian on n x n nodes for each of two components.
Matrix laplacian(int n) {
    Matrix A;
    A.columns = 2 * n * n;
    for (int i = 0; i < n * n; ++i) {
        for (int c = 0; c < 2; ++c) {
            if (i >= n) A.add(2 * (i - n) + c, -1.0);
            if (i % n > 0) A.add(2 * (i - 1) + c, -1.0);
            A.add(2 * i + c, 4.0);
            if (i % n < n - 1) A.add(2 * (i + 1) + c, -1.0);
            if (i < n * n - n) A.add(2 * (i + n) + c, -1.0);
            A.end_row();
        }
    }
    return A;
}

// Bilinear interpolation from m x m to (2 m + 1) x (2 m + 1) nodes.
Matrix interpolation(int m) {
    const int n = 2 * m + 1;
    Matrix P;
    P.columns = 2 * m * m;
    for (int i = 0; i < n * n; ++i) {
        for (int c = 0; c < 2; ++c) {
            const int row = i / n, column = i % n;
            for (int a = (row - 1) / 2; a <= row / 2; ++a) {
                for (int b = (column - 1) / 2; b <= column / 2; ++b) {
                    const int up = std::abs(2 * a + 1 - row), left = std::abs(2 * b + 1 - column);
                    if (a < 0 || b < 0 || a >= m || b >= m || up > 1 || left > 1) continue;
                    P.add(2 * (a * m + b) + c, (up ? 0.5 : 1.0) * (left ? 0.5 : 1.0));
                }
            }
            P.end_row();
        }
    }
    return P;
}

void check(bool holds, const char* what) {
    if (holds) return;
    std::fprintf(stderr, "%s\n", what);
    std::exit(1);
}

// A cube of n^dim cubes, each cut into dim! simplices along its diagonal.
struct Body {
    int dim;
    int64_t nodes = 1;
    std::vector<int64_t> cells;
    std::vector<double> points, volumes;

    Body(int dimension, int n) : dim(dimension) {
        int64_t steps[3] = {0, 0, 0}, cubes = 1;
        for (int k = 0; k < dim; ++k) {
            steps[k] = nodes;
            nodes *= n + 1;
            cubes *= n;
        }
        for (int64_t i = 0; i < nodes; ++i) {
            for (int k = 0; k < dim; ++k) points.push_back(static_cast<double>(i / steps[k] % (n + 1)) / n);
        }
        for (int64_t cube = 0; cube < cubes; ++cube) {
            int64_t corner = 0, rest = cube;
            for (int k = 0; k < dim; ++k, rest /= n) corner += rest % n * steps[k];
            std::vector<int> order{0, 1, 2};
            order.resize(dim);
            do {
                cells.push_back(corner);
                int64_t at = corner;
                for (int k : order) cells.push_back(at += steps[k]);
                volumes.push_back(1.0 / (cubes * (dim == 2 ? 2 : 6)));
            } while (std::next_permutation(order.begin(), order.end()));
        }
    }
    Simplices simplices() const { return {dim, nodes, static_cast<int64_t>(volumes.size()), cells.data()}; }
};

// All that is made of it, one after the other.
std::vector<double> sums(const Body& body, int components, bool varying) {
    const Edges edges(body.simplices());
    const int64_t count = static_cast<int64_t>(edges.other.size()), size = components * components;
    const int64_t total = static_cast<int64_t>(body.volumes.size());
    std::vector<int64_t> pairs(2 * count), cell_edges(total * (body.dim == 2 ? 3 : 6));
    edges.get(pairs.data(), cell_edges.data());
    const Graph graph(body.nodes, count, pairs.data());
    std::vector<int32_t> strains;
    const int strain = components == 1 ? body.dim : body.dim * (body.dim + 1) / 2;
    for (int i = 0; i < components; ++i) {
        for (int k = 0; k < body.dim; ++k) {
            strains.push_back(components == 1 || i == k ? k : (body.dim == 2 ? 2 : 6 - i - k));
        }
    }
    std::vector<double> matrix, upper(count * size, 0.0), diagonal(body.nodes * size);
    for (int64_t cell = 0; cell < (varying ? total : 1); ++cell) {
        for (int k = 0; k < strain * strain; ++k) matrix.push_back(k % (strain + 1) ? 0.25 : 2.0 + cell % 3);
    }
    const int64_t half = varying ? total / 2 : total, one = varying ? half : 1;
    const auto law = [&](int64_t from, int64_t matrices) {
        return Law{components, strain, strains.data(), matrices, matrix.data() + from * strain * strain};
    };
    const double* volumes = body.volumes.data();
    graph.add(body.simplices(), body.points.data(), volumes, 0, half, law(0, one), upper.data());
    if (varying) {
        graph.add(body.simplices(), body.points.data(), volumes + half, half, total, law(half, total - half), upper.data());
    }
    graph.close(components, upper.data(), diagonal.data());
    std::vector<uint8_t> free(body.nodes * components, 1);
    for (size_t k = 0; k < free.size(); k += 5) free[k] = 0;
    std::vector<int32_t> indptr(std::count(free.begin(), free.end(), 1) + 1);
    const int64_t entries = graph.lengths(components, free.data(), indptr.data());
    std::vector<int32_t> indices(entries);
    std::vector<double> data(entries);
    graph.rows(components, free.data(), diagonal.data(), upper.data(), indptr.data(), indices.data(), data.data());
    double largest = 0.0;
    for (double value : data) largest = std::max(largest, std::abs(value));
    check(std::isfinite(largest) && largest > 0.0, "a stiffness is not a number, or zero");
    for (size_t row = 0; row + 1 < indptr.size(); ++row) {
        double own = 0.0;
        for (int32_t e = indptr[row]; e < indptr[row + 1]; ++e) {
            check(e == indptr[row] || indices[e] > indices[e - 1], "columns are not in order");
            if (indices[e] == static_cast<int32_t>(row)) own = data[e];
        }
        check(own > 0.0, "a diagonal entry is not positive");
    }
    std::vector<double> all(cell_edges.begin(), cell_edges.end());
    all.insert(all.end(), indices.begin(), indices.end());
    all.insert(all.end(), data.begin(), data.end());
    return all;
}

template <class Work>
bool refused(const Work& work) {
    try {
        work();
    } catch (const std::exception&) {
        return true;
    }
    return false;
}

// A unit lower triangle whose columns share their rows in runs of 1, 2, ..., 13, and substitution through it.
void substitute() {
    const int32_t n = 120, count = 91;
    std::vector<int32_t> starts{0}, rows;
    std::vector<double> entries;
    for (int32_t width = 1, first = 0; first < count; first += width++) {
        for (int32_t j = first; j < first + width; ++j) {
            for (int32_t i = j; i < n; ++i) {
                if (i >= first + width && (i + width) % 3 != 0) continue;
                rows.push_back(i);
                entries.push_back(i == j ? 1.0 : 0.25 / (1 + (i + j) % 5) / width);
            }
            starts.push_back(static_cast<int32_t>(rows.size()));
        }
    }
    check(starts.size() == count + 1, "the triangle has another size");
    const Panels panels(count, starts.data(), rows.data(), entries.data());
    std::vector<double> right(n), x, back(n), turned;
    for (int32_t i = 0; i < n; ++i) right[i] = 1.0 + i % 7;
    x = turned = right;
    panels.forward(x.data());
    panels.backward(turned.data());
    std::vector<double> of_rows(n, 0.0), of_columns(turned);
    for (int32_t j = 0; j < n; ++j) of_rows[j] += j < count ? 0.0 : x[j];
    for (int32_t j = 0; j < count; ++j) {
        of_columns[j] = 0.0;
        for (int32_t e = starts[j]; e < starts[j + 1]; ++e) {
            of_rows[rows[e]] += entries[e] * x[j];
            of_columns[j] += entries[e] * turned[rows[e]];
        }
    }
    for (int32_t i = 0; i < n; ++i) {
        check(std::fabs(of_rows[i] - right[i]) < 1e-10, "substitution does not solve with the triangle");
        check(std::fabs(of_columns[i] - right[i]) < 1e-10, "substitution does not solve with its transpose");
    }
}

// Springs on a rigid obstacle: the points that are pushed in are held, the others fly.
void settle(int64_t n) {
    const double inf = std::numeric_limits<double>::infinity();
    std::vector<double> stiffness(n, 3.0), bounds(2 * n, 0.0), zero(3 * n, 0.0), low(n, 0.0), high(n, inf);
    std::vector<double> first(n, -inf), last(n, 0.0), matrix(n * n, 0.0), weights(n, 0.5), compliance(n, 0.5);
    for (int64_t i = 0; i < n; ++i) {
        bounds[n + i] = inf;
        for (int64_t j = 0; j < n; ++j) matrix[i * n + j] = i == j ? 2.0 : 0.01;
    }
    const Tables law{n,           3,           stiffness.data(), bounds.data(), zero.data(), zero.data(), zero.data(),
                     zero.data(), low.data(),  high.data(),      first.data(),  last.data()};
    ActiveSets sets(law, matrix.data(), weights.data(), compliance.data());
    std::vector<double> load(n), r(n, 0.0), lam(n, 0.0), of_law(n);
    for (int64_t i = 0; i < n; ++i) load[i] = i % 2 ? 1.0 : -1.0;
    double told[3];
    check(sets.run(load.data(), r.data(), lam.data(), of_law.data(), 20, 0.0, 1e-12, 1.0, told) == ActiveSets::kClose,
          "the rounds do not settle");
    for (int64_t i = 0; i < n; ++i) {
        check(i % 2 ? r[i] == 0.0 && of_law[i] > 0.0 : r[i] < 0.0 && of_law[i] == 0.0, "a point is on another piece");
    }
    check(sets.distance(r.data(), of_law.data()) < 1e-12, "the pairs are off their law");
    matrix[0] = -1.0;
    lam.assign(n, -1.0);
    load.assign(n, -1.0);
    ActiveSets soft(law, matrix.data(), weights.data(), compliance.data());
    check(soft.run(load.data(), r.data(), lam.data(), of_law.data(), 20, 0.0, 1e-12, 1.0, told) == ActiveSets::kGivenUp,
          "a matrix that is not definite is taken");
}

// Points on a rigid obstacle that are pressed with one force and pulled with a half and a fifth of it in turn: with the
// coefficient 0.3 the first slide and the others stick.
void slide(int64_t points) {
    const double inf = std::numeric_limits<double>::infinity();
    const int64_t n = 2 * points;
    std::vector<double> stiffness(n, 3.0), bounds(2 * n, 0.0), anchor(3 * n, 0.0), base(3 * n, 0.0), slope(3 * n, 0.0);
    std::vector<double> knots(n, 0.0), low(n, 0.0), high(n, inf), first(n, -inf), last(n, 0.0), matrix(n * n, 0.0);
    std::vector<double> weights(n, 0.5), compliance(n, 0.5), coefficient(points, 0.3), load(n), r(n, 0.0), lam(n, 0.0);
    for (int64_t i = 0; i < n; ++i) {
        bounds[n + i] = inf;
        matrix[i * n + i] = 2.0;
        load[i] = i % 2 == 0 ? 1.0 : i % 4 == 1 ? 0.5 : 0.2;
        if (i % 2 == 0) continue;
        low[i] = base[i] = -1.0;
        high[i] = base[2 * n + i] = 1.0;
        last[i] = inf;
    }
    const Tables law{n,           3,           stiffness.data(), bounds.data(), anchor.data(), base.data(),       slope.data(),
                     knots.data(), low.data(), high.data(),      first.data(),  last.data(),   coefficient.data()};
    ActiveSets sets(law, matrix.data(), weights.data(), compliance.data());
    std::vector<double> of_law(n);
    double told[3];
    check(sets.run(load.data(), r.data(), lam.data(), of_law.data(), 20, 0.0, 1e-12, 1.0, told) == ActiveSets::kClose,
          "the rounds with friction do not settle");
    for (int64_t i = 1; i < n; i += 2) {
        check(r[i - 1] == 0.0 && std::fabs(of_law[i - 1] - 2.0) < 1e-12, "a point is not held");
        check(i % 4 == 1 ? std::fabs(r[i] - 0.1) < 1e-12 : r[i] == 0.0, "a point slides another way");
    }
    check(sets.distance(r.data(), of_law.data()) < 1e-12, "the pairs are off Coulomb's law");
    for (int64_t i = 0; i < n; ++i) matrix[i] = 0.0;
    load[0] = -1.0;
    ActiveSets loose(law, matrix.data(), weights.data(), compliance.data());
    check(loose.run(load.data(), r.data(), lam.data(), of_law.data(), 20, 0.0, 1e-12, 1.0, told) == ActiveSets::kGivenUp,
          "a singular matrix is taken");
}

// Springs from 0.1 on, one row for all points, or one for each, and friction that weakens; points at rest, at the knot,
// far away, and such as are no numbers.
void answer_of_laws(int64_t m, int64_t d, bool each, int64_t formula) {
    const int64_t rows = each ? m : 1;
    std::vector<double> springs, friction, factor(rows, 0.5);
    const double inf = std::numeric_limits<double>::infinity();
    for (int64_t i = 0; i < rows; ++i) {
        for (double number : {-inf, inf, 0.0, 0.1, 0.0, 0.0}) springs.push_back(number);
        for (double slope : {0.0, 2.0}) springs.insert(springs.end(), {0.1, 0.0, slope, 0.1, 0.0, 0.0});
        for (double number : {-inf, inf, 1.0, 0.0, -1.0, 1.0}) friction.push_back(number);
        const std::vector<double> pieces{0.0, -1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0};
        const std::vector<double> known{formula == ScalarLaw::kExponential ? 0.5 : 1.0, 0.5, 1.0};
        const std::vector<double>& rest = formula == ScalarLaw::kStraight ? pieces : known;
        friction.insert(friction.end(), rest.begin(), rest.end());
    }
    const auto length = [&](const std::vector<double>& all) { return static_cast<int64_t>(all.size()) / rows; };
    const PointLaw law{{rows, 1, 0, rows, length(springs), springs.data(), factor.data()},
                       {rows, 1, formula, rows, length(friction), friction.data(), factor.data()}};
    std::vector<double> r(m * d), lam(m * d), pair(2 * m, 4.0), out(m * d), near(m * d), hessian(m * d * d), found(m);
    std::vector<uint8_t> smooth(2 * m);
    for (int64_t i = 0; i < m * d; ++i) {
        r[i] = i % d ? (i % 5 ? 0.3 * (i % 7 - 3.0) : 0.0) : 0.1 * (i % 4);
        lam[i] = 0.2 * (i % 9 - 4.0);
    }
    law.value(m, d, r.data(), found.data());
    for (double value : found) check(value >= 0.0 && std::isfinite(value), "an energy is none");
    law.linearise(m, d, r.data(), smooth.data(), out.data(), hessian.data());
    law.nearest(m, d, r.data(), lam.data(), near.data());
    law.distance(m, d, r.data(), near.data(), pair.data(), found.data());
    for (double value : found) check(value < 1e-12, "the nearest multiplier is off its law");
    check(law.minimise(m, d, pair.data(), r.data(), out.data()), "points have no minimiser");
    for (int64_t i = 0; i < m * d; ++i) lam[i] = r[i] - 4.0 * out[i];
    law.distance(m, d, out.data(), lam.data(), pair.data(), found.data());
    for (double value : found) check(value < 1e-12, "a minimiser is off its law");
    law.clamp(m, d, r.data(), lam.data(), out.data());
    pair.assign(2 * m, 0.1);
    check(d == 1 || formula != ScalarLaw::kLogarithmic || !law.minimise(m, d, pair.data(), r.data(), out.data()),
          "hills are taken for none");
    r.assign(m * d, std::nan(""));
    law.distance(m, d, r.data(), lam.data(), pair.data(), found.data());
    for (double value : found) check(std::isnan(value), "what is no number has a distance");
    check(!law.minimise(m, d, pair.data(), r.data(), out.data()), "what is no number has a minimiser");
}

// n^dim cubes, each cut into simplices along the ways from its lowest corner to its highest one.
struct Cut {
    int dim, count, l;
    std::vector<double> points, gradients, signs, energies, compliance;
    std::vector<int64_t> cells, cell_facets, facet_nodes, alike, owners;

    Cut(int dim, int n, bool apart) : dim(dim), l(dim) {
        const int side = n + 1;
        int nodes = 1, cubes = 1;
        for (int i = 0; i < dim; ++i) {
            nodes *= side;
            cubes *= n;
        }
        for (int k = 0; k < nodes; ++k) {
            for (int i = 0, rest = k; i < dim; ++i, rest /= side) points.push_back(rest % side);
        }
        for (int cube = 0; cube < cubes; ++cube) {
            int corner = 0, step[3] = {1, side, side * side};
            for (int i = 0, rest = cube; i < dim; ++i, rest /= n) corner += rest % n * step[i];
            std::vector<int> way(dim);
            for (int i = 0; i < dim; ++i) way[i] = i;
            int number = 0;
            do {
                int node = corner;
                cells.push_back(node);
                std::vector<double> matrix(dim * dim, 0.0);  // its inverse takes steps along axes to the edges
                for (int i = 0; i < dim; ++i) {
                    cells.push_back(node += step[way[i]]);
                    matrix[i * dim + way[i]] = 1.0;
                    if (i + 1 < dim) matrix[i * dim + way[i + 1]] = -1.0;
                }
                for (int k = 0; k < dim; ++k) {
                    double sum = 0.0;
                    for (int i = 0; i < dim; ++i) sum -= matrix[i * dim + k];
                    gradients.push_back(sum);
                }
                gradients.insert(gradients.end(), matrix.begin(), matrix.end());
                alike.push_back(apart ? static_cast<int64_t>(alike.size()) : number);
                ++number;
            } while (std::next_permutation(way.begin(), way.end()));
        }
        count = static_cast<int>(cells.size()) / (dim + 1);
        std::map<std::vector<int64_t>, int64_t> known;
        for (int c = 0; c < count; ++c) {
            for (int f = 0; f <= dim; ++f) {
                std::vector<int64_t> facet;
                for (int a = 0; a <= dim; ++a) {
                    if (a != f) facet.push_back(cells[c * (dim + 1) + a]);
                }
                const auto found = known.emplace(facet, static_cast<int64_t>(known.size()));
                if (found.second) {
                    facet_nodes.insert(facet_nodes.end(), facet.begin(), facet.end());
                    owners.push_back(0);
                }
                ++owners[found.first->second];
                cell_facets.push_back(found.first->second);
                signs.push_back(found.second ? 1.0 : -1.0);
            }
        }
        // Energies that are definite: the first number of the compliance weighs the unit matrix, the rest nothing.
        const int whole = (dim + 1) * dim * dim, modes = dim * (dim + 1) / 2, v = modes * (modes + 1) / 2;
        energies.assign(whole * v * whole, 0.0);
        for (int r = 0; r < whole; ++r) energies[(r * v) * whole + r] = 1.0;
        for (int c = 0; c < count; ++c) {
            compliance.push_back(apart ? 1.0 + 0.1 * (c % 7) : 1.0);
            for (int k = 1; k < v; ++k) compliance.push_back(0.0);
        }
    }

    PatchBody body() const {
        return {dim, l, 0, count, static_cast<int64_t>(owners.size()), energies.data(), compliance.data(),
                gradients.data(), signs.data(), points.data(), cell_facets.data(), facet_nodes.data(), alike.data()};
    }
};

double square(const std::vector<double>& numbers) {
    double sum = 0.0;
    for (double x : numbers) sum += x * x;
    return sum;
}

// Sweeps over the patches of vertices: the same bits with any threads, less energy, no cell out of balance.
void improve_simplices(int dim, int n, bool apart, bool priced) {
    const Cut mesh(dim, n, apart);
    const int corners = dim + 1, block = dim * dim, moments = corners * block;
    const int64_t nodes = static_cast<int64_t>(mesh.points.size()) / dim, facets = mesh.body().facets;
    std::vector<int64_t> sides, ranked(nodes), start(nodes + 1), seen(mesh.cells.size()), order(nodes);
    std::vector<int64_t> bounds(kColours + 1), rows(facets, -1);
    for (int a = 0; a < corners; ++a) {
        for (int f = 0; f < corners; ++f) {
            if (f != a) sides.push_back(f);
        }
    }
    for (int64_t k = 0; k < nodes; ++k) ranked[k] = (k * 7919) % nodes;
    const int64_t colours = colour_patches(mesh.count, corners, mesh.cells.data(), nodes, ranked.data(), start.data(),
                                           seen.data(), order.data(), bounds.data());
    check(colours > 1 && bounds[colours] == nodes, "patches without a colour");
    std::vector<uint8_t> free(facets, 1);
    std::vector<double> matrices, offsets;
    for (int64_t f = 0; f < facets; ++f) {
        if (mesh.owners[f] == 2 || f % 3 == 0) continue;
        free[f] = priced;
        if (!priced) continue;
        rows[f] = static_cast<int64_t>(offsets.size()) / block;
        for (int k = 0; k < block * block; ++k) matrices.push_back(k % (block + 1) == 0 ? 0.5 : 0.0);
        for (int k = 0; k < block; ++k) offsets.push_back(0.1 * k);
    }
    std::vector<std::vector<double>> found;
    for (int threads : {1, 4}) {
        Pool::set_threads(threads);
        std::vector<double> slope(mesh.count * moments), stress(facets * block, 0.0);
        for (size_t k = 0; k < slope.size(); ++k) slope[k] = std::sin(1.0 + static_cast<double>(k));
        const double before = square(slope);  // with the unit matrix energy and slope are the same
        const PatchBody body = mesh.body();
        const PatchSweep sweep{corners, dim, nodes, colours, sides.data(), start.data(), seen.data(), order.data(),
                          bounds.data(), free.data(), priced ? rows.data() : nullptr, matrices.data(), offsets.data(),
                          slope.data(), stress.data()};
        for (int turn = 0; turn < 2; ++turn) improve_patches(body, sweep);
        const double after = square(slope);
        check(std::isfinite(after) && (priced || apart || after < before), "patches do not lower the energy");
        for (int c = 0; c < mesh.count; ++c) {
            for (int i = 0; i < dim; ++i) {
                double force = 0.0;
                for (int f = 0; f < corners; ++f) {
                    const int64_t facet = mesh.cell_facets[c * corners + f];
                    for (int a = 0; a < dim; ++a) {
                        force += mesh.signs[c * corners + f] * stress[facet * block + a * dim + i];
                    }
                }
                check(std::abs(force) < 1e-11, "a cell is out of balance");
            }
        }
        check(square(stress) > 1e-6, "nothing moves");
        slope.insert(slope.end(), stress.begin(), stress.end());
        found.push_back(slope);
    }
    check(found[0] == found[1], "bits of patches depend on the number of threads");
}

// Sums over the cells of an element with tables at random: the same bits with any threads, and the slopes of energies.
void add_up_simplices(int dim, int inner, bool slopes) {
    const Cut mesh(dim, dim == 2 ? 9 : 4, true);
    const int corners = dim + 1, moments = corners * dim * dim, v = dim * (dim + 1) / 2, upper = v * (v + 1) / 2;
    const int degrees = moments + 3, pieces = 4, loads = corners * dim;
    int state = 1;
    auto some = [&](int64_t count) {
        std::vector<double> found(count);
        for (double& x : found) x = static_cast<double>(state = state * 75 % 65537) / 65537.0 - 0.4;
        return found;
    };
    const std::vector<double> values = some(corners * pieces * v * degrees), loading = some(degrees * (moments + loads));
    const std::vector<double> own = some(mesh.count * corners * dim), given = some(mesh.count * loads);
    std::vector<double> ways(degrees * (moments + inner)), mass(pieces * pieces, 0.1), energies(upper * inner * inner, 0.0);
    for (int r = 0; r < degrees; ++r) {
        for (int k = 0; k < moments; ++k) ways[r * (moments + inner) + k] = loading[r * (moments + loads) + k];
        for (int i = 0; i < inner; ++i) ways[r * (moments + inner) + moments + i] = r == i ? 1.0 : 0.0;
    }
    for (int a = 0; a < pieces; ++a) mass[a * pieces + a] = 0.5;
    for (int i = 0; i < inner; ++i) energies[i * inner + i] = 50.0;
    const CellElement element{dim, dim, inner, degrees, pieces, values.data(), mass.data(), loading.data(), ways.data(),
                              energies.data()};
    std::vector<double> compliance(mesh.count * upper), unit(v * v, 0.0), sizes(mesh.count, 2.0);
    for (int p = 0; p < v; ++p) unit[p * v + p] = 1.0;
    pull_back(dim, mesh.count, 1, unit.data(), mesh.points.data(), mesh.cells.data(), sizes.data(), compliance.data());
    const int64_t facets = mesh.body().facets;
    std::vector<double> stress = some(facets * dim * dim);
    std::vector<std::vector<double>> found;
    double value[3] = {};
    std::vector<double> slope(mesh.count * moments);
    const auto pass = [&](std::vector<double>& out) {
        out.assign(mesh.count, 0.0);
        const CellStresses body{mesh.count, facets, 1, compliance.data(), mesh.alike.data(), mesh.gradients.data(),
                                mesh.signs.data(), mesh.cell_facets.data(), stress.data(), own.data(), -1.0,
                                given.data(), inner ? nullptr : given.data(), out.data(),
                                slopes ? slope.data() : nullptr};
        add_up_cells(element, body);
        double sum = 0.0;
        for (double x : out) sum += x;
        return sum;
    };
    for (int threads : {1, 4}) {
        Pool::set_threads(threads);
        found.emplace_back();
        value[0] = pass(found.back());
        found.back().insert(found.back().end(), slope.begin(), slope.end());
    }
    check(found[0] == found[1], "bits of cells depend on the number of threads");
    if (!slopes || inner) return;
    const std::vector<double> before = slope;
    const int64_t changed = facets / 2 * dim * dim;  // a moment: its slope by differences
    std::vector<double> out;
    for (int turn : {1, 2}) {
        stress[changed] += turn == 1 ? 0.5 : -1.0;
        value[turn] = pass(out);
    }
    double expected = 0.0;
    for (int64_t c = 0; c < mesh.count; ++c) {
        for (int f = 0; f < corners; ++f) {
            if (mesh.cell_facets[c * corners + f] != facets / 2) continue;
            for (int r = 0; r < dim; ++r) {
                expected += mesh.signs[c * corners + f] * mesh.gradients[(c * corners + r + 1) * dim] *
                            before[c * moments + f * dim * dim + r];
            }
        }
    }
    std::vector<int64_t> edges, ends;  // of facets, as numbers of edges: every edge has cells that are its own
    for (int a = 0; a < corners; ++a) {
        for (int c = a + 1; c < corners; ++c) ends.insert(ends.end(), {a, c});
    }
    for (int64_t k = 0; k < mesh.count * static_cast<int64_t>(ends.size() / 2); ++k) edges.push_back(k);
    const std::vector<uint8_t> inside(facets, 1);
    const std::vector<double> flat(mesh.count * dim * dim, 0.0);
    const CellBubbles bubbles{dim, mesh.count, static_cast<int64_t>(edges.size()), facets, 1, unit.data(),
                              mesh.gradients.data(), sizes.data(), flat.data(), given.data(), edges.data(),
                              mesh.cell_facets.data(), ends.data(), inside.data()};
    std::vector<double> stresses(flat), forces(given);
    strain_cells(dim, mesh.count, 1, mesh.points.data(), mesh.cells.data(), mesh.gradients.data(), sizes.data(),
                 unit.data(), stresses.data(), forces.data());
    for (int64_t k = 0; k < static_cast<int64_t>(stresses.size()); ++k) {  // the places themselves as displacements
        check(stresses[k] == (k % (dim * dim) % (dim + 1) == 0 ? 1.0 : 0.0), "the stress of a stretch is not one");
    }
    const double square = unresolved_square(bubbles);
    check(square > 0.0 && std::isfinite(square), "bubbles see no load");
    check(std::abs(value[1] - value[2] - 2.0 * expected) < 1e-9 * value[0], "slopes are not those of the energies");
}

// Facets and stars of cells whose vertices rise, with numbers that are made up.
struct Stars {
    int64_t dim, cells, nodes, facets, corners = dim + 1, size = cells * corners * dim;
    std::vector<int64_t> vertices, numbers, owners, ends, others, start, pairs, every, outer;
    std::vector<int32_t> place;
    std::vector<double> signs, forces, loads, given, unknown, dear, missed, ones, measures;
    std::vector<uint8_t> interior, contact;

    Stars(int64_t dim, int64_t nodes, const std::vector<int64_t>& given_cells, const std::vector<double>& points = {})
        : dim(dim), cells(static_cast<int64_t>(given_cells.size()) / (dim + 1)), nodes(nodes), vertices(given_cells),
          numbers(size / dim), start(nodes + 1), pairs(size / dim), every(nodes), place(size / dim), signs(size / dim),
          forces(size), loads(size, 0.1), dear(cells), missed(nodes * dim, 0.3) {
        const Facets table(static_cast<int>(dim), nodes, cells, vertices.data(), nullptr);
        facets = table.count;
        owners.resize(2 * facets);
        ends.resize(facets * dim);
        others.resize(facets * dim);
        table.get(vertices.data(), numbers.data(), signs.data(), owners.data(), ends.data(), others.data());
        if (!points.empty()) {
            const size_t square = static_cast<size_t>(dim * dim);
            std::vector<double> matrix(cells * square), slopes(size), normals(facets * dim);
            measures.resize(facets);
            measure_simplices(static_cast<int>(dim), cells, points.data(), vertices.data(), numbers.data(), signs.data(),
                              matrix.data(), slopes.data(), normals.data(), measures.data());
            check(*std::min_element(measures.begin(), measures.end()) > 0.0, "a facet without an area");
        }
        list_stars(static_cast<int>(corners), nodes, cells, vertices.data(), start.data(), pairs.data(), place.data());
        outer.assign(facets, -1);
        ones.assign(cells + facets, 1.0);
        interior.resize(facets);
        contact.resize(facets);
        for (int64_t k = 0; k < nodes; ++k) every[k] = k;
        for (int64_t k = 0; k < size; ++k) forces[k] = std::sin(1.0 + static_cast<double>(k));
        for (int64_t cell = 0; cell < cells; ++cell) dear[cell] = 1.0 + 0.1 * static_cast<double>(cell % 7);
        for (int64_t facet = 0; facet < facets; ++facet) {
            interior[facet] = owners[2 * facet + 1] >= 0;
            contact[facet] = !interior[facet] && facet % 3 == 0;
            if (interior[facet]) continue;
            outer[facet] = static_cast<int64_t>(unknown.size()) / (dim * dim);
            for (int64_t k = 0; k < dim * dim; ++k) unknown.push_back(facet % 3 == 1 && k == 0);
        }
        given.assign(unknown.size(), 0.2);
    }
    StarBody body() const {
        return {dim, dim, corners, nodes, nodes, cells, facets, vertices.data(), numbers.data(), owners.data(),
                interior.data(), contact.data(), ones.data(), ones.data(), dear.data(), forces.data(), loads.data(),
                nullptr, outer.data(), given.data(), unknown.data(), given.data(), missed.data(), start.data(),
                pairs.data(), place.data()};
    }
};

// As many facets as there are, the same bits with any threads, no cell out of balance.
void settle_simplices(int dim, int n) {
    const Cut mesh(dim, n, false);
    const int64_t nodes = static_cast<int64_t>(mesh.points.size()) / dim;
    std::vector<std::vector<double>> found;
    for (int threads : {1, 4}) {
        Pool::set_threads(threads);
        const Stars stars(dim, nodes, mesh.cells, mesh.points);
        check(stars.facets == mesh.body().facets, "a facet is missing");
        std::vector<double> moments(stars.facets * dim * dim), shared(moments.size(), 0.0), defect(stars.size), lost(stars.size);
        check(settle_stars(stars.body(), moments.data(), defect.data(), lost.data()) == -1, "cells are said to be apart");
        share_on_contact(stars.body(), nodes, stars.every.data(), shared.data());
        for (int64_t k = 0; k < stars.size; ++k) {
            const int64_t cell = k / (stars.corners * dim), corner = k / dim % stars.corners;
            double left = stars.forces[k] - stars.loads[k] - defect[k];
            for (int64_t side = 0; side < stars.corners; ++side) {
                if (side == corner) continue;
                const int64_t at = cell * stars.corners + side, node = corner - (corner > side);
                left -= stars.signs[at] * moments[(stars.numbers[at] * dim + node) * dim + k % dim];
            }
            check(std::abs(left) < 1e-11, "a cell is out of balance at a node");
        }
        check(square(moments) > 1e-6 && square(shared) > 1e-6, "no moment at all");
        found.push_back(moments);
        for (const auto& more : {defect, lost, shared, stars.signs, stars.measures}) {
            found.back().insert(found.back().end(), more.begin(), more.end());
        }
    }
    check(found[0] == found[1], "bits of tractions depend on the number of threads");
}

// Kinds of rows, more than the first table holds.
void number_rows() {
    std::vector<double> rows, more;
    for (int i = 0; i < 6000; ++i) {
        for (int k = 0; k < 3; ++k) rows.push_back(i % 3 == 0 ? 0.0 : 1.0 + i % 2000 * (k + 1));
        more.push_back(i < 3000 ? 1.0 : 1.0 + 1e-13);
    }
    std::vector<int64_t> found(more.size());
    number_alike(static_cast<int64_t>(more.size()), {{3, rows.data()}, {1, more.data()}}, 1e-9, found.data());
    for (size_t i = 1; i < found.size(); ++i) {
        const bool same = std::equal(&rows[3 * i], &rows[3 * i] + 3, &rows[0]);
        check((found[i] == found[0]) == same, "rows that differ have one number, or equal ones two");
        if (i >= 2000 && i % 3 != 0 && (i - 2000) % 3 != 0) check(found[i] == found[i - 2000], "equal rows differ");
    }
}

void refuse_stars() {
    const Stars apart(2, 5, {0, 1, 2, 0, 3, 4});
    std::vector<double> moments(apart.given.size()), defect(apart.size), lost(apart.size);
    const int64_t found = settle_stars(apart.body(), moments.data(), defect.data(), lost.data());
    check(found == 0, "cells that meet at a vertex alone are not told");
    Stars wrong(2, 4, {0, 1, 2, 1, 2, 3});
    std::swap(wrong.place[1], wrong.place[3]);
    check(refused([&] { settle_stars(wrong.body(), moments.data(), defect.data(), lost.data()); }), "wrong stars");
    check(refused([] { Stars(2, 3, {1, 0, 2}); }), "places that fall are taken");
    check(refused([] { Stars(2, 3, {0, 1, 3}); }), "a node that is not there is taken");
}

}  // namespace

int main() {
    substitute();
    for (int64_t n : {1, 2, 7, 40}) settle(n);
    for (int64_t n : {1, 2, 7, 40}) slide(n);
    std::vector<std::vector<double>> found;
    for (int threads : {1, 3}) {
        Pool::set_threads(threads);
        found.emplace_back();
        for (int dim : {2, 3}) {
            for (int components : {1, dim}) {
                for (bool varying : {false, true}) {
                    for (int n : {1, dim == 2 ? 40 : 12}) {
                        const std::vector<double> one = sums(Body(dim, n), components, varying);
                        found.back().insert(found.back().end(), one.begin(), one.end());
                    }
                }
            }
        }
    }
    check(found[0] == found[1], "bits of a stiffness depend on the number of threads");
    Body wrong(3, 2);
    wrong.cells[7] = wrong.nodes;
    check(refused([&] { Edges(wrong.simplices()); }), "a node that is not there is taken");
    for (int n : {1, 8}) settle_simplices(2, n);
    for (int n : {1, 5}) settle_simplices(3, n);
    refuse_stars();
    number_rows();
    const int64_t pairs[] = {0, 1, 0, 1};
    check(refused([&] { Graph(2, 2, pairs); }), "an edge is taken twice");
    const std::vector<int> sizes{7, 15, 31, 63};
    std::vector<std::vector<float>> answers;
    for (int threads : {1, 4}) {
        Pool::set_threads(threads);
        Levels levels(static_cast<int64_t>(sizes.size()));
        std::vector<Matrix> matrices;
        for (int n : sizes) matrices.push_back(laplacian(n));
        for (size_t k = 0; k < sizes.size(); ++k) {
            const int64_t n = matrices[k].columns;
            std::vector<int32_t> place(n), contact;
            std::vector<float> signs(n, 1.0f);
            for (int64_t i = 0; i < n; ++i) place[i] = static_cast<int32_t>(i);
            for (int64_t i = 0; i < 2 * sizes[k]; ++i) contact.push_back(static_cast<int32_t>(i));
            levels.levels[k] = std::make_unique<Level>(matrices[k].csr(), 2, n / 2, place.data(), signs.data(),
                                                       contact.data(), static_cast<int64_t>(contact.size()));
            if (k == 0) continue;
            const Matrix P = interpolation(sizes[k - 1]);
            levels.transfers[k - 1] = std::make_unique<Transfer>(P.csr(), *levels.levels[k], *levels.levels[k - 1]);
            check(levels.transfers[k - 1]->components == 2, "interpolation is not seen to go by nodes");
        }
        const Level& top = *levels.levels.back();
        // On the coarsest level the root of the inverse of the diagonal serves.
        const int64_t n = top.n, coarse = levels.levels[0]->n;
        std::vector<double> root(coarse * coarse, 0.0), right(n), out(n);
        for (int64_t i = 0; i < coarse; ++i) root[i * coarse + i] = 0.5;
        std::vector<uint8_t> held(top.contact_slots.size(), 0);
        for (size_t i = 0; i < held.size(); i += 3) held[i] = 1;
        std::vector<double> values;
        for (size_t i = 0; i < top.contact_slots.size(); ++i) {
            for (int32_t e = matrices.back().indptr[i]; e < matrices.back().indptr[i + 1]; ++e) {
                const bool own = matrices.back().indices[e] == static_cast<int32_t>(i);
                values.push_back(held[i] ? (own ? 1.0 : 0.0) : matrices.back().data[e]);
            }
        }
        for (int64_t i = 0; i < n; ++i) right[i] = i < static_cast<int64_t>(held.size()) && held[i] ? 0.0 : 1.0 + i % 7;
        auto turn = [&](std::vector<double>* found) {
            Truncation truncation(levels);
            truncation.set_root(root.data());
            truncation.change(3, held.data(), values.data());
            for (int k = 0; k < 5; ++k) truncation.cycle(3, right.data(), found->data());
        };
        std::vector<double> other(n);
        std::thread beside(turn, &other);
        turn(&out);
        beside.join();
        check(out == other, "two threads find different answers");
        double product = 0.0;
        for (int64_t i = 0; i < n; ++i) product += out[i] * right[i];
        check(product > 0.0 && std::isfinite(product), "the cycle is not positive");
        for (size_t i = 0; i < held.size(); ++i) check(!held[i] || out[i] == 0.0, "a held unknown moves");
        answers.emplace_back(out.begin(), out.end());
    }
    check(answers[0] == answers[1], "bits depend on the number of threads");
    for (int64_t d : {1, 2, 3}) {
        for (int64_t formula : {ScalarLaw::kStraight, ScalarLaw::kLogarithmic, ScalarLaw::kExponential}) {
            answer_of_laws(37, d, false, formula);
            answer_of_laws(37, d, true, formula);
        }
    }
    for (bool apart : {false, true}) {
        for (bool priced : {false, true}) {
            improve_simplices(2, 12, apart, priced);
            improve_simplices(3, apart ? 3 : 5, apart, priced);
        }
    }
    for (bool slopes : {false, true}) {
        add_up_simplices(2, 0, slopes);
        add_up_simplices(2, 3, slopes);
        add_up_simplices(3, 0, slopes);
    }
    std::puts("the kernels stand");
}
