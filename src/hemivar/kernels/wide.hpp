// SIMD: numbers of eight things at once, for processors with wider registers: every one of the eight is treated
// alike, so that no bit depends on the processor.
#pragma once

#include <cstdint>

#if defined(__GNUC__)
#define HEMIVAR_INLINE inline __attribute__((always_inline))
#else
#define HEMIVAR_INLINE inline
#endif
// A function for those processors alone, whose body is an inline one.
#if defined(__GNUC__) && defined(__x86_64__)
#define HEMIVAR_WIDE __attribute__((target("avx2")))
#else
#define HEMIVAR_WIDE
#endif

namespace hemivar {

constexpr int64_t kEight = 8;

// Compilers would else take numbers of several rows together, which stand far apart.
HEMIVAR_INLINE void row_by_row() {
#if defined(__GNUC__)
    asm volatile("");
#endif
}

// Numbers that are looked at soon.
template <class T>
HEMIVAR_INLINE void fetch(const T* from, int64_t count) {
#if defined(__GNUC__)
    constexpr int64_t line = 64 / sizeof(T);
    for (int64_t k = 0; k < count; k += line) __builtin_prefetch(from + k);
    __builtin_prefetch(from + count - 1);
#else
    static_cast<void>(from), static_cast<void>(count);
#endif
}

inline bool wide_registers() {
#if defined(__GNUC__) && defined(__x86_64__)
    static const bool found = __builtin_cpu_supports("avx2");
    return found;
#else
    return false;
#endif
}

// Loops, which compilers turn into operations of the widest registers that a function may use.
template <class T>
struct Eight {
    T lane[kEight];
    T& operator[](int64_t k) { return lane[k]; }
    T operator[](int64_t k) const { return lane[k]; }
#define HEMIVAR_EACH(sign)                                                          \
    Eight& operator sign##=(const Eight& other) {                                   \
        for (int64_t k = 0; k < kEight; ++k) lane[k] sign##= other.lane[k];         \
        return *this;                                                               \
    }                                                                               \
    friend Eight operator sign(Eight a, const Eight& b) { return a sign##= b; }     \
    friend Eight operator sign(Eight a, T b) {                                      \
        for (int64_t k = 0; k < kEight; ++k) a.lane[k] sign##= b;                   \
        return a;                                                                   \
    }
    HEMIVAR_EACH(+)
    HEMIVAR_EACH(-)
    HEMIVAR_EACH(*)
    HEMIVAR_EACH(/)
#undef HEMIVAR_EACH
    friend Eight operator*(T a, const Eight& b) { return b * a; }
    HEMIVAR_INLINE void add(T a, const Eight& b) {
        for (int64_t k = 0; k < kEight; ++k) lane[k] += a * b.lane[k];
    }
    HEMIVAR_INLINE void add(const Eight& a, const Eight& b) {
        for (int64_t k = 0; k < kEight; ++k) lane[k] += a.lane[k] * b.lane[k];
    }
};
typedef Eight<double> Doubles;
typedef Eight<float> Floats;

}  // namespace hemivar
