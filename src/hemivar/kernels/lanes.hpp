// SIMD: sums of blocks times vectors, four numbers side by side. Blocks of d x d are stored column by column.
//
// Loads of four floats reach up to one float beyond a block of three: arrays of blocks end with kBeyond more.
#pragma once

#include <cstdint>
#include <cstring>

namespace hemivar {

constexpr int64_t kBeyond = 4;

#if defined(__GNUC__)
typedef float Four __attribute__((vector_size(16)));
typedef double Twice __attribute__((vector_size(16)));
typedef int Order __attribute__((vector_size(16)));
#else
struct Four {
    float lane[4];
    float& operator[](int k) { return lane[k]; }
    float operator[](int k) const { return lane[k]; }
    Four& operator+=(const Four& other) {
        for (int k = 0; k < 4; ++k) lane[k] += other.lane[k];
        return *this;
    }
    friend Four operator+(Four a, const Four& b) { return a += b; }
    friend Four operator*(Four a, const Four& b) {
        for (int k = 0; k < 4; ++k) a.lane[k] *= b.lane[k];
        return a;
    }
};
#endif

inline Four four(const float* from) {
    Four found;
    std::memcpy(&found, from, sizeof found);
    return found;
}

inline Four alike(float x) { return Four{x, x, x, x}; }

// {x[0], x[0], x[1], x[1]}
inline Four pairs(const float* x) {
#if defined(__GNUC__) && !defined(__clang__)
    double both;
    std::memcpy(&both, x, sizeof both);
    const Four found = reinterpret_cast<Four>(Twice{both, both});
    return __builtin_shuffle(found, Order{0, 0, 1, 1});
#else
    return Four{x[0], x[0], x[1], x[1]};
#endif
}

template <int D>
struct Sum {
    float part[D] = {};
    void add(const float* block, const float* x) {
        for (int j = 0; j < D; ++j) {
            for (int i = 0; i < D; ++i) part[i] += block[j * D + i] * x[j];
        }
    }
    void get(float* out) const { std::memcpy(out, part, sizeof part); }
};

template <>
struct Sum<2> {
    Four part = {0.0f, 0.0f, 0.0f, 0.0f};
    void add(const float* block, const float* x) { part += four(block) * pairs(x); }
    void get(float* out) const {
        const float both[2] = {part[0] + part[2], part[1] + part[3]};
        std::memcpy(out, both, sizeof both);  // in one piece, for it is read so
    }
};

template <>
struct Sum<3> {
    Four first = {0.0f, 0.0f, 0.0f, 0.0f}, second = first, third = first;
    void add(const float* block, const float* x) {
        first += four(block) * alike(x[0]);
        second += four(block + 3) * alike(x[1]);
        third += four(block + 6) * alike(x[2]);
    }
    void get(float* out) const {
        const Four sum = first + second + third;
        for (int i = 0; i < 3; ++i) out[i] = sum[i];
    }
};

}  // namespace hemivar
