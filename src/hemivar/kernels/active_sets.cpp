// Newton's equations of active sets, by a dense factor of Cholesky.
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

// Sort the pairs (r, lam) onto the law: r where it is to be linearised, and what the law says there.
void ActiveSets::onto(double* r, const double* lam) {
    const int64_t n = law_.n;
    for (int64_t i = 0; i < n; ++i) {
        const double pull = law_.stiffness[i] * r[i] + lam[i];
        int64_t state = 0;
        for (int64_t k = 0; k + 1 < law_.states; ++k) state += pull > law_.bounds[k * n + i];
        const int64_t at = state * n + i;
        state_[i] = state;
        if (state & 1) {
            r[i] = law_.anchor[at];
            law_force_[i] = pull - law_.stiffness[i] * r[i];
        } else {
            law_force_[i] = law_.base[at] + law_.slope[at] * (r[i] - law_.anchor[at]);
        }
    }
}

// L of the Newton matrix of the free components; false where it is not definite. It serves while the states stay.
bool ActiveSets::factorise() {
    if (state_ == known_) return true;
    known_[0] = -1;
    const int64_t n = law_.n;
    free_.clear();
    for (int64_t i = 0; i < n; ++i) {
        if (!(state_[i] & 1)) free_.push_back(i);
    }
    const int64_t count = static_cast<int64_t>(free_.size());
    double* U = factor_.data();  // L', row by row
    for (int64_t a = 0; a < count; ++a) {
        const int64_t i = free_[a];
        for (int64_t b = a; b < count; ++b) U[a * count + b] = matrix_[i * n + free_[b]];
        U[a * count + a] += weights_[i] * law_.slope[state_[i] * n + i];
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

void ActiveSets::solve(double* x) const {
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
        int64_t at = i;  // of the piece that r lies on; a kink belongs to the piece to its left
        double least = std::numeric_limits<double>::infinity();
        for (int64_t k = 0; k < kinks; ++k) {
            const double knot = law_.knots[k * n + i];
            const double beside = std::max(std::max(law_.low[k * n + i] - lam[i], lam[i] - law_.high[k * n + i]), 0.0);
            least = std::min(least, std::hypot((r[i] - knot) / compliance_[i], beside));
            at += r[i] > knot ? 2 * n : 0;
        }
        if (r[i] >= law_.first[i] && r[i] <= law_.last[i]) {
            least = std::min(least, std::fabs(lam[i] - (law_.base[at] + law_.slope[at] * (r[i] - law_.anchor[at]))));
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
