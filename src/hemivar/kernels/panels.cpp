// Forward and backward substitution through panels (supernodes) of a factor.
#include "panels.hpp"

#include <algorithm>

namespace hemivar {

namespace {

// x[row] -= the row of the panel times the unknowns of the panel.
void take_off(const double* entries, const double* own, int64_t width, double& x) {
    double sum[4] = {0.0, 0.0, 0.0, 0.0};
    int64_t k = 0;
    for (; k + 4 <= width; k += 4) {
        for (int j = 0; j < 4; ++j) sum[j] += entries[k + j] * own[k + j];
    }
    for (; k < width; ++k) sum[0] += entries[k] * own[k];
    x -= (sum[0] + sum[2]) + (sum[1] + sum[3]);
}

// The same for N columns of a panel, transposed: their unknowns less all rows below them.
template <int N>
void gather(const double* entries, int64_t width, const int32_t* rows, int64_t count, const double* x, double* own) {
    double sum[N] = {};
    for (int64_t i = 0; i < count; ++i, entries += width) {
        const double value = x[rows[i]];
        for (int j = 0; j < N; ++j) sum[j] += entries[j] * value;
    }
    for (int j = 0; j < N; ++j) own[j] -= sum[j];
}

}  // namespace

Panels::Panels(int64_t count, const int32_t* starts, const int32_t* rows, const double* entries) {
    int64_t row_at = 0, entry_at = 0;
    for (int64_t j = 0; j < count;) {
        int64_t end = j + 1;
        for (; end < count; ++end) {  // the next column begins where this one goes on
            const int64_t below = starts[end] - starts[end - 1] - 1;
            if (starts[end + 1] - starts[end] != below) break;
            if (!std::equal(rows + starts[end], rows + starts[end + 1], rows + starts[end - 1] + 1)) break;
        }
        const int64_t width = end - j, below = starts[end] - starts[end - 1] - 1;
        panels_.push_back({j, width, below, row_at, entry_at});
        row_at += below;
        entry_at += width * (width - 1) / 2 + width * below;
        j = end;
    }
    rows_.resize(row_at);
    entries_.resize(entry_at);
    for (const Panel& panel : panels_) {
        const int64_t j = panel.first, w = panel.width;
        std::copy_n(rows + starts[j + w] - panel.rows, panel.rows, rows_.data() + panel.row_at);
        double* out = entries_.data() + panel.entry_at;
        for (int64_t k = 0; k < w; ++k) out = std::copy_n(entries + starts[j + k] + 1, w - 1 - k, out);
        for (int64_t i = 0; i < panel.rows; ++i) {
            for (int64_t k = 0; k < w; ++k) *out++ = entries[starts[j + k] + w - k + i];
        }
    }
}

void Panels::forward(double* x) const {
    for (const Panel& panel : panels_) {
        const int64_t w = panel.width;
        const int32_t* rows = rows_.data() + panel.row_at;
        const double* entries = entries_.data() + panel.entry_at;
        double* own = x + panel.first;
        for (int64_t k = 0; k < w; ++k) {
            for (int64_t i = k + 1; i < w; ++i) own[i] -= *entries++ * own[k];
        }
        if (w == 1) {
            const double value = own[0];
            for (int64_t i = 0; i < panel.rows; ++i) x[rows[i]] -= entries[i] * value;
            continue;
        }
        for (int64_t i = 0; i < panel.rows; ++i, entries += w) take_off(entries, own, w, x[rows[i]]);
    }
}

void Panels::backward(double* x) const {
    for (auto panel = panels_.rbegin(); panel != panels_.rend(); ++panel) {
        const int64_t w = panel->width, count = panel->rows;
        const int32_t* rows = rows_.data() + panel->row_at;
        const double* triangle = entries_.data() + panel->entry_at + w * (w - 1) / 2;  // its end
        double* own = x + panel->first;
        int64_t k = 0;
        for (; k + 8 <= w; k += 8) gather<8>(triangle + k, w, rows, count, x, own + k);
        for (; k + 4 <= w; k += 4) gather<4>(triangle + k, w, rows, count, x, own + k);
        for (; k + 2 <= w; k += 2) gather<2>(triangle + k, w, rows, count, x, own + k);
        if (k < w) gather<1>(triangle + k, w, rows, count, x, own + k);
        for (k = w - 1; k >= 0; --k) {
            triangle -= w - 1 - k;
            for (int64_t i = k + 1; i < w; ++i) own[k] -= triangle[i - k - 1] * own[i];
        }
    }
}

}  // namespace hemivar
