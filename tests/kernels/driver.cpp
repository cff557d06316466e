// The compiled kernels by themselves, for the sanitizers of a compiler: a square by bilinear levels, two unknowns a node.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <thread>
#include <vector>

#include "levels.hpp"
#include "pool.hpp"

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

}  // namespace

int main() {
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
    std::puts("the kernels stand");
}
