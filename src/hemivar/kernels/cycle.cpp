// Multigrid cycles (Gauss-Seidel smoothing, transfer, coarse solve) and matrix-vector products.
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "lanes.hpp"
#include "levels.hpp"
#include "pool.hpp"

namespace hemivar {

namespace {

// Where the numbers of a row are: on the level, or in the copy for a solve.
struct Place {
    const float *block, *own, *inverse;
};

// Rows in order, up or down, with their numbers.
template <int D>
class Walk {
public:
    Walk(const Level& level, const Changed& changed, int64_t from, bool down)
        : level_(level), rows_(changed.rows), down_(down), active_(changed.active) {
        if (!active_) return;
        const auto& nodes = level.contact_nodes;
        at_ = (down ? std::upper_bound(nodes.begin(), nodes.end(), from)
                    : std::lower_bound(nodes.begin(), nodes.end(), from)) - nodes.begin() - (down ? 1 : 0);
        look();
    }

    Place operator()(int64_t i) {
        constexpr int64_t dd = D * D;
        const bool mine = i == next_;
        const Rows& rows = mine ? rows_ : level_.rows;
        const int64_t row = mine ? at_ : i, first = mine ? level_.contact_start[at_] : level_.start[i];
        if (mine) {
            at_ += down_ ? -1 : 1;
            look();
        }
        return {rows.block.data() + first * dd, rows.own.data() + row * dd, rows.inverse.data() + row * dd};
    }

private:
    void look() {
        const bool there = at_ >= 0 && at_ < static_cast<int64_t>(level_.contact_nodes.size());
        next_ = there ? level_.contact_nodes[at_] : -1;
    }

    const Level& level_;
    const Rows& rows_;
    const bool down_, active_;
    int64_t at_ = 0, next_ = -1;
};

// A row of (L + D w) x = b.
template <int D>
void forward_row(const Level& level, const Place& at, int64_t i, const float* b, float* x) {
    const int32_t* column = level.column.data() + level.start[i];
    Sum<D> sum, moved;
    const int count = level.before[i];
    for (int e = 0; e < count; ++e) sum.add(at.block + e * D * D, x + int64_t{column[e]} * D);
    float right[D];
    sum.get(right);
    for (int c = 0; c < D; ++c) right[c] = b[i * D + c] - right[c];
    moved.add(at.inverse, right);
    moved.get(x + i * D);
}

// A row of (D w + U) y = b - (A - D w - U) x.
template <int D>
void backward_row(const Level& level, const Place& at, int64_t i, const float* b, const float* x, float* y) {
    const int32_t* column = level.column.data() + level.start[i];
    const int count = level.start[i + 1] - level.start[i], known = level.before[i] + level.outside[i];
    Sum<D> behind, sum, moved;
    // Memory is read downwards without a break, which processors foresee.
    for (int e = count - 1; e >= known; --e) behind.add(at.block + e * D * D, y + int64_t{column[e]} * D);
    for (int e = known - 1; e >= 0; --e) sum.add(at.block + e * D * D, x + int64_t{column[e]} * D);
    float right[D], other[D];
    sum.get(right);
    behind.get(other);
    for (int c = 0; c < D; ++c) right[c] = b[i * D + c] - right[c] - other[c];
    const float more = level.weight[i] - 1.0f;
    if (more > 0.0f) {
        Sum<D> own;
        float kept[D];
        own.add(at.own, x + i * D);
        own.get(kept);
        for (int c = 0; c < D; ++c) right[c] += more * kept[c];
    }
    moved.add(at.inverse, right);
    moved.get(y + i * D);
}

// Each block of the smoother by itself; two of them in turn, for a row waits for the one before it.
template <int D, class Row>
void in_blocks(const Level& level, const Changed& changed, bool down, const Row& row) {
    const int64_t size = level.block;
    share((level.pieces() + 1) / 2, [&](int64_t piece) {
        const int64_t low = 2 * piece * size, middle = std::min(level.nodes, low + size);
        const int64_t high = std::min(level.nodes, middle + size), first = middle - low, second = high - middle;
        Walk<D> walk(level, changed, down ? middle - 1 : low, down), other(level, changed, down ? high - 1 : middle, down);
        for (int64_t k = 0; k < first; ++k) {
            const int64_t i = down ? middle - 1 - k : low + k;
            row(walk(i), i);
            if (k < second) {
                const int64_t j = down ? high - 1 - k : middle + k;
                row(other(j), j);
            }
        }
    });
}

// b - A x after `forward_row` on all of them: what these left out.
template <int D>
void rest_after(const Level& level, const Changed& changed, const float* x, float* rest) {
    share((level.nodes + kChunk - 1) / kChunk, [&](int64_t piece) {
        const int64_t low = piece * kChunk, high = std::min(level.nodes, low + kChunk);
        Walk<D> walk(level, changed, low, false);
        for (int64_t i = low; i < high; ++i) {
            const Place at = walk(i);
            const int32_t* column = level.column.data() + level.start[i];
            const int count = level.start[i + 1] - level.start[i];
            Sum<D> sum;
            for (int e = level.before[i]; e < count; ++e) sum.add(at.block + e * D * D, x + int64_t{column[e]} * D);
            float out[D];
            sum.get(out);
            for (int c = 0; c < D; ++c) out[c] = -out[c];
            const float more = level.weight[i] - 1.0f;
            if (more > 0.0f) {
                Sum<D> own;
                float kept[D];
                own.add(at.own, x + i * D);
                own.get(kept);
                for (int c = 0; c < D; ++c) out[c] += more * kept[c];
            }
            for (int c = 0; c < D; ++c) rest[i * D + c] = out[c];
        }
    });
}

template <int D>
void transfer(const Array<int32_t>& start, const Array<int32_t>& column, const Array<float>& weight,
              const float* x, float* out, bool add) {
    const int64_t rows = static_cast<int64_t>(start.size()) - 1, chunk = kChunk * 6 / D;
    share((rows + chunk - 1) / chunk, [&](int64_t piece) {
        for (int64_t i = piece * chunk; i < std::min(rows, (piece + 1) * chunk); ++i) {
            float sum[D] = {};
            for (int32_t e = start[i]; e < start[i + 1]; ++e) {
                for (int c = 0; c < D; ++c) sum[c] += weight[e] * x[int64_t{column[e]} * D + c];
            }
            for (int c = 0; c < D; ++c) out[i * D + c] = add ? out[i * D + c] + sum[c] : sum[c];
        }
    });
}

// The same by blocks of R x C; columns in two sums, for each waits for the number before it.
template <int R, int C>
void transfer_blocks(const Array<int32_t>& start, const Array<int32_t>& column, const Array<float>& weight,
                     const float* x, float* out, bool add) {
    const int64_t rows = static_cast<int64_t>(start.size()) - 1;
    share((rows + kChunk - 1) / kChunk, [&](int64_t piece) {
        for (int64_t i = piece * kChunk; i < std::min(rows, (piece + 1) * kChunk); ++i) {
            float sum[R] = {}, other[R] = {};
            for (int32_t e = start[i]; e < start[i + 1]; ++e) {
                const float *block = weight.data() + int64_t{e} * R * C, *from = x + int64_t{column[e]} * C;
                for (int j = 0; j < C; ++j) {
                    float* part = j % 2 ? other : sum;
                    for (int k = 0; k < R; ++k) part[k] += block[j * R + k] * from[j];
                }
            }
            for (int k = 0; k < R; ++k) out[i * R + k] = (add ? out[i * R + k] : 0.0f) + sum[k] + other[k];
        }
    });
}

template <template <int> class Function, class... Arguments>
void by_size(int d, Arguments&&... arguments) {
    switch (d) {
        case 1: return Function<1>::run(arguments...);
        case 2: return Function<2>::run(arguments...);
        case 3: return Function<3>::run(arguments...);
        default: return Function<6>::run(arguments...);
    }
}

template <int D>
struct Down {
    static void run(const Level& level, const Changed& changed, const float* b, float* x, float* rest) {
        in_blocks<D>(level, changed, false, [&](const Place& at, int64_t i) { forward_row<D>(level, at, i, b, x); });
        rest_after<D>(level, changed, x, rest);
    }
};

template <int D>
struct Up {
    static void run(const Level& level, const Changed& changed, const float* b, const float* x, float* y) {
        in_blocks<D>(level, changed, true, [&](const Place& at, int64_t i) { backward_row<D>(level, at, i, b, x, y); });
    }
};

template <int D>
struct Across {
    static void run(const Transfer& between, const float* x, float* out, bool up) {
        if (up) {
            transfer<D>(between.start, between.column, between.weight, x, out, true);
        } else {
            transfer<D>(between.back_start, between.back_column, between.back_weight, x, out, false);
        }
    }
};

template <int R>
struct AcrossBlocks {
    template <int C>
    struct With {
        static void run(const Transfer& between, const float* x, float* out, bool up) {
            if (up) {
                transfer_blocks<R, C>(between.start, between.column, between.weight, x, out, true);
            } else {
                transfer_blocks<C, R>(between.back_start, between.back_column, between.back_weight, x, out, false);
            }
        }
    };
    static void run(const Transfer& between, const float* x, float* out, bool up) {
        by_size<With>(between.columns, between, x, out, up);
    }
};

void cross(const Transfer& between, const float* x, float* out, bool up) {
    if (between.rows > 1) return by_size<AcrossBlocks>(between.rows, between, x, out, up);
    by_size<Across>(between.components, between, x, out, up);
}

float* buffer(Scratch& scratch, int64_t k, int which, int64_t size) {
    Array<float>& one = scratch[3 * k + which];
    if (static_cast<int64_t>(one.size()) < size) one.resize(size);
    return one.data();
}

void solve_coarsest(const Truncation& t, Scratch& scratch) {
    const Level& level = t.level(0);
    const int64_t n = level.n, size = level.nodes * level.d;
    const float* b = buffer(scratch, 0, 0, size);
    float *x = buffer(scratch, 0, 1, size), *through = buffer(scratch, 0, 2, size);
    std::fill(through, through + n, 0.0f);
    std::fill(x, x + size, 0.0f);
    for (int64_t i = 0; i < n; ++i) {
        const float value = b[level.place[i]], *row = t.root.data() + i * n;
        for (int64_t j = t.first[i]; j < n; ++j) through[j] += value * row[j];
    }
    for (int64_t i = 0; i < n; ++i) {
        const float* row = t.root.data() + i * n;
        float sums[8] = {};  // side by side, in a fixed order
        int64_t j = t.first[i];
        for (; j + 8 <= n; j += 8) {
            for (int s = 0; s < 8; ++s) sums[s] += row[j + s] * through[j + s];
        }
        for (; j < n; ++j) sums[0] += row[j] * through[j];
        x[level.place[i]] = ((sums[0] + sums[4]) + (sums[1] + sums[5])) + ((sums[2] + sums[6]) + (sums[3] + sums[7]));
    }
}

// The answer is in buffer 1 of the level.
void descend(const Truncation& t, int64_t k, Scratch& scratch) {
    if (k == 0) return solve_coarsest(t, scratch);
    const Level &level = t.level(k), &below = t.level(k - 1);
    const Changed &changed = t.changed[k], &under = t.changed[k - 1];
    const Transfer& between = *t.levels.transfers[k - 1];
    const int64_t size = level.nodes * level.d, small = below.nodes * below.d;
    const float* b = buffer(scratch, k, 0, size);
    float *x = buffer(scratch, k, 1, size), *rest = buffer(scratch, k, 2, size);
    by_size<Down>(level.d, level, changed, b, x, rest);
    float* coarse = buffer(scratch, k - 1, 0, small);
    buffer(scratch, k - 1, 1, small);
    cross(between, rest, coarse, false);
    for (int32_t slot : under.held) coarse[slot] = 0.0f;
    descend(t, k - 1, scratch);
    cross(between, buffer(scratch, k - 1, 1, small), x, true);
    for (int32_t slot : changed.held) x[slot] = 0.0f;
    by_size<Up>(level.d, level, changed, b, x, rest);
    scratch[3 * k + 1].swap(scratch[3 * k + 2]);
}

}  // namespace

std::unique_ptr<Scratch> Levels::borrow() const {
    std::unique_lock<std::mutex> lock(idle_lock_, std::try_to_lock);
    if (lock.owns_lock() && !idle_.empty()) {
        auto found = std::move(idle_.back());
        idle_.pop_back();
        return found;
    }
    return std::make_unique<Scratch>(3 * levels.size());
}

void Levels::give_back(std::unique_ptr<Scratch> scratch) const {
    std::unique_lock<std::mutex> lock(idle_lock_, std::try_to_lock);
    if (lock.owns_lock()) idle_.push_back(std::move(scratch));
}

void Truncation::cycle(int64_t top, const double* right, double* out) const {
    const Level& level = this->level(top);
    const int64_t coarsest = this->level(0).n, d = level.d;
    if (static_cast<int64_t>(root.size()) != coarsest * coarsest) throw std::logic_error("no root");
    const int64_t size = level.nodes * d, chunk = 4 * kChunk, pieces = (level.n + chunk - 1) / chunk;
    auto scratch = levels.borrow();
    float* b = buffer(*scratch, top, 0, size);
    buffer(*scratch, top, 1, size);
    if (!level.plain) std::fill(b, b + size, 0.0f);
    // Only the size matters, not the units: forces as small as 1e-300 must not vanish.
    double most = 0.0;
    for (int64_t k = 0; k < level.n; ++k) most = std::max(most, std::abs(right[k] * level.unit[k]));
    const double size_of = most > 0.0 && std::isfinite(most) ? most : 1.0;
    share(pieces, [&](int64_t piece) {
        for (int64_t k = piece * chunk; k < std::min(level.n, (piece + 1) * chunk); ++k) {
            b[level.place[k]] = static_cast<float>(right[k] * level.unit[k] / size_of);
        }
    });
    descend(*this, top, *scratch);
    const float* x = buffer(*scratch, top, 1, size);
    share(pieces, [&](int64_t piece) {
        for (int64_t k = piece * chunk; k < std::min(level.n, (piece + 1) * chunk); ++k) {
            out[k] = static_cast<double>(x[level.place[k]]) * level.unit[k] * size_of;
        }
    });
    levels.give_back(std::move(scratch));
}

}  // namespace hemivar
