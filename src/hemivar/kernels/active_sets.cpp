// The linear systems of primal-dual active sets (semismooth Newton), by a dense Cholesky factor.
#include "active_sets.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace hemivar {

namespace {

// Without overflow or underflow on the way; nan if an entry is.
template <class Entry>
double norm(int64_t n, const Entry& entry) {
    double largest = 0.0, sum = 0.0;
    for (int64_t i = 0; i < n; ++i) {
        const double size = std::fabs(entry(i));
        if (!(size <= largest)) largest = size;
        if (std::isnan(size)) return size;
    }
    if (largest == 0.0 || std::isinf(largest)) return largest;
    int exponent;
    std::frexp(largest, &exponent);
    for (int64_t i = 0; i < n; ++i) {
        const double scaled = std::ldexp(entry(i), -exponent);
        sum += scaled * scaled;
    }
    return std::ldexp(std::sqrt(sum), exponent);
}

}  // namespace

// By what the tables of a component are multiplied.
double ActiveSets::bound(int64_t i, double pressure) const {
    return follows(i) ? law_.coefficient[i / 2] * std::max(pressure, 0.0) : 1.0;
}

// The state in which a component has the number pull = stiffness r + lam.
int64_t ActiveSets::state_of(int64_t i, double pull, double most) const {
    const int64_t n = law_.n;
    int64_t state = 0;
    if (!follows(i)) {
        for (int64_t k = 0; k + 1 < law_.states; ++k) state += pull > law_.bounds[k * n + i];
        return state;
    }
    for (int64_t k = 0; k < law_.states / 2; ++k) {
        const double at = law_.stiffness[i] * law_.knots[k * n + i];
        const double low = at + most * law_.low[k * n + i], high = at + most * law_.high[k * n + i];
        if (std::isfinite(at)) state += (low == high ? pull > high : pull >= low) + (pull > high);
    }
    return state;
}

// Sort the pairs (r, lam) onto the law: r where it is to be linearised, and what the law says there. Where friction
// follows the pressure that is the pair of the law with the same stiffness r + lam.
void ActiveSets::onto(double* r, const double* lam) {
    const int64_t n = law_.n;
    for (int64_t i = 0; i < n; ++i) {
        const double a = law_.stiffness[i], pull = a * r[i] + lam[i];
        const double most = bound(i, i ? law_force_[i - 1] : 0.0);
        const int64_t state = state_of(i, pull, most), at = state * n + i;
        const double anchor = law_.anchor[at], base = most * law_.base[at];
        state_[i] = state;
        slope_[i] = most * law_.slope[at];
        pushed_[i] = 0.0;
        if (state & 1) {
            r[i] = anchor;
            law_force_[i] = pull - a * anchor;
            continue;
        }
        if (law_.coefficient && a + slope_[i] > 0.0) r[i] = anchor + (pull - a * anchor - base) / (a + slope_[i]);
        law_force_[i] = base + slope_[i] * (r[i] - anchor);
        if (follows(i) && most > 0.0) {
            pushed_[i] = law_.coefficient[i / 2] * (law_.base[at] + law_.slope[at] * (r[i] - anchor));
        }
    }
}

// Whether the matrix is the one whose factor is known.
bool ActiveSets::same() const {
    if (state_ != known_) return false;
    return !law_.coefficient || (slope_ == known_slope_ && pushed_ == known_pushed_);
}

// L of the Newton matrix of the free components; false where it is not definite. It serves while the states stay.
bool ActiveSets::factorise() {
    if (same()) return true;
    known_[0] = -1;
    const int64_t n = law_.n;
    free_.clear();
    for (int64_t i = 0; i < n; ++i) {
        if (!(state_[i] & 1)) free_.push_back(i);
    }
    if (law_.coefficient) return factorise_following();
    const int64_t count = static_cast<int64_t>(free_.size());
    double* U = factor_.data();  // L', row by row
    for (int64_t a = 0; a < count; ++a) {
        const int64_t i = free_[a];
        for (int64_t b = a; b < count; ++b) U[a * count + b] = matrix_[i * n + free_[b]];
        U[a * count + a] += weights_[i] * slope_[i];
    }
    for (int64_t a = 0; a < count; ++a) {
        double* row = U + a * count;
        if (!(row[a] > 0.0) || !std::isfinite(row[a])) return false;
        const double root = std::sqrt(row[a]), inverse = 1.0 / root;
        row[a] = root;
        for (int64_t b = a + 1; b < count; ++b) row[b] *= inverse;
        for (int64_t b = a + 1; b < count; ++b) {
            double* below = U + b * count;
            const double factor = row[b];
            for (int64_t c = b; c < count; ++c) below[c] -= factor * row[c];
        }
    }
    known_ = state_;
    return true;
}

// The same where friction follows the pressure: L and U, rows exchanged; false where the matrix is singular.
bool ActiveSets::factorise_following() {
    const int64_t n = law_.n, count = static_cast<int64_t>(free_.size());
    double* F = factor_.data();
    for (int64_t a = 0; a < count; ++a) {
        const int64_t i = free_[a];
        double* row = F + a * count;
        for (int64_t b = 0; b < count; ++b) row[b] = matrix_[i * n + free_[b]];
        row[a] += weights_[i] * slope_[i];
        if (pushed_[i] == 0.0) continue;
        if (a > 0 && free_[a - 1] == i - 1) {  // the pressure is that of the law
            row[a - 1] += weights_[i] * pushed_[i] * slope_[i - 1];
        } else {  // it is that of the body
            for (int64_t b = 0; b < count; ++b) row[b] -= pushed_[i] * matrix_[(i - 1) * n + free_[b]];
        }
    }
    for (int64_t k = 0; k < count; ++k) {
        int64_t best = k;
        for (int64_t a = k + 1; a < count; ++a) {
            if (std::fabs(F[a * count + k]) > std::fabs(F[best * count + k])) best = a;
        }
        pivots_[k] = best;
        if (best != k) std::swap_ranges(F + k * count, F + (k + 1) * count, F + best * count);
        const double* row = F + k * count;
        if (row[k] == 0.0 || !std::isfinite(row[k])) return false;
        for (int64_t a = k + 1; a < count; ++a) {
            double* below = F + a * count;
            if (below[k] == 0.0) continue;
            const double factor = below[k] /= row[k];
            for (int64_t b = k + 1; b < count; ++b) below[b] -= factor * row[b];
        }
    }
    known_ = state_;
    known_slope_ = slope_;
    known_pushed_ = pushed_;
    return true;
}

void ActiveSets::solve_following(double* x) const {
    const int64_t count = static_cast<int64_t>(free_.size());
    for (int64_t k = 0; k < count; ++k) std::swap(x[k], x[pivots_[k]]);
    for (int64_t a = 0; a < count; ++a) {
        for (int64_t b = 0; b < a; ++b) x[a] -= factor_[a * count + b] * x[b];
    }
    for (int64_t a = count - 1; a >= 0; --a) {
        for (int64_t b = a + 1; b < count; ++b) x[a] -= factor_[a * count + b] * x[b];
        x[a] /= factor_[a * count + a];
    }
}

void ActiveSets::solve(double* x) const {
    if (law_.coefficient) return solve_following(x);
    const int64_t count = static_cast<int64_t>(free_.size());
    for (int64_t a = 0; a < count; ++a) {
        const double* row = factor_.data() + a * count;
        x[a] /= row[a];
        for (int64_t b = a + 1; b < count; ++b) x[b] -= row[b] * x[a];
    }
    for (int64_t a = count - 1; a >= 0; --a) {
        const double* row = factor_.data() + a * count;
        double even = 0.0, odd = 0.0;
        int64_t b = a + 1;
        for (; b + 2 <= count; b += 2) {
            even += row[b] * x[b];
            odd += row[b + 1] * x[b + 1];
        }
        if (b < count) even += row[b] * x[b];
        x[a] = (x[a] - (even + odd)) / row[a];
    }
}

double ActiveSets::distance(const double* r, const double* lam) {
    const int64_t n = law_.n, kinks = law_.states / 2;
    for (int64_t i = 0; i < n; ++i) {
        if (std::isnan(r[i]) || std::isnan(lam[i])) return std::nan("");
        const double most = bound(i, i ? lam[i - 1] : 0.0);
        int64_t at = i;  // of the piece that r lies on; a kink belongs to the piece to its left
        double least = std::numeric_limits<double>::infinity();
        for (int64_t k = 0; k < kinks; ++k) {
            const double knot = law_.knots[k * n + i];
            const double low = most * law_.low[k * n + i], high = most * law_.high[k * n + i];
            const double beside = std::max(std::max(low - lam[i], lam[i] - high), 0.0);
            least = std::min(least, std::hypot((r[i] - knot) / compliance_[i], beside));
            at += r[i] > knot ? 2 * n : 0;
        }
        if (r[i] >= law_.first[i] && r[i] <= law_.last[i]) {
            const double line = law_.base[at] + law_.slope[at] * (r[i] - law_.anchor[at]);
            least = std::min(least, std::fabs(lam[i] - most * line));
        }
        step_[i] = weights_[i] * least;
    }
    return norm(n, [&](int64_t i) { return step_[i]; });
}

ActiveSets::End ActiveSets::run(const double* load, double* r, double* lam, double* of_law, int64_t most, double atol,
                                double rtol, double load_size, double* told) {
    const int64_t n = law_.n;
    for (int64_t i = 0; i < n; ++i) {
        if (!std::isfinite(law_.stiffness[i] * r[i] + lam[i])) return kGivenUp;
    }
    onto(r, lam);
    for (int64_t round = 1; round <= most; ++round) {
        if (!factorise()) return kGivenUp;
        const int64_t count = static_cast<int64_t>(free_.size());
        // The matrix is symmetric: its rows are its columns.
        std::copy_n(load, n, balance_.data());
        for (int64_t j = 0; j < n; ++j) {
            const double value = r[j], *row = matrix_ + j * n;
            for (int64_t i = 0; i < n; ++i) balance_[i] -= row[i] * value;
        }
        for (int64_t a = 0; a < count; ++a) {
            const int64_t i = free_[a];
            step_[a] = balance_[i] - weights_[i] * law_force_[i];
            if (pushed_[i] == 0.0 || (a > 0 && free_[a - 1] == i - 1)) continue;
            step_[a] -= pushed_[i] * (balance_[i - 1] - weights_[i - 1] * law_force_[i - 1]);
        }
        solve(step_.data());
        for (int64_t a = 0; a < count; ++a) {
            const double value = step_[a], *row = matrix_ + free_[a] * n;
            r[free_[a]] += value;
            for (int64_t i = 0; i < n; ++i) balance_[i] -= row[i] * value;
        }
        for (int64_t i = 0; i < n; ++i) lam[i] = balance_[i] / weights_[i];
        std::copy_n(r, n, step_.data());  // what is returned is the pair of the body, before it is sorted
        onto(r, lam);
        const double missed = norm(n, [&](int64_t i) { return weights_[i] * (law_force_[i] - lam[i]); });
        told[0] = static_cast<double>(round);
        told[1] = missed;
        if (!std::isfinite(missed)) return kGivenUp;
        told[2] = norm(n, [&](int64_t i) { return weights_[i] * law_force_[i]; });
        if (missed <= atol + rtol * std::max(load_size, told[2])) {
            std::copy_n(step_.data(), n, r);
            std::copy_n(law_force_.data(), n, of_law);
            return kClose;
        }
    }
    return kOpen;
}

}  // namespace hemivar
