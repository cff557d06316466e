// Laws of contact points that split: a scalar law of the penetration, and one of the length of the slip.
#pragma once

#include <cstdint>

namespace hemivar {

// A scalar law times a factor, one row of numbers for all points or one for each: ends of the domain and weak convexity;
// each knot, inf where it is unused, with the slopes to its left and right; then the pieces. A straight one is an anchor
// with slope and bend there, and a place with slope and energy there; the formulas have parameters in their place.
struct ScalarLaw {
    enum Formula { kStraight = 0, kLogarithmic = 1, kExponential = 2 };

    int64_t rows, knots, formula, factors, length;  // length of a row
    const double *numbers, *factor;
};

// Local displacements and multipliers of m points are (m, d); the slip law is looked at where d > 1.
struct PointLaw {
    ScalarLaw normal, slip;

    void value(int64_t m, int64_t d, const double* r, double* out) const;
    // smooth (m, 2), gradient (m, d), hessian (m, d, d).
    void linearise(int64_t m, int64_t d, const double* r, uint8_t* smooth, double* gradient, double* hessian) const;
    void nearest(int64_t m, int64_t d, const double* r, const double* lam, double* out) const;
    void clamp(int64_t m, int64_t d, const double* start, const double* end, double* out) const;
    // tau (m, 2); out (m,).
    void distance(int64_t m, int64_t d, const double* r, const double* lam, const double* tau, double* out) const;
    // a (m, 2), b (m, d). False where a law bends more than a, or a point has no minimiser: then others must look.
    bool minimise(int64_t m, int64_t d, const double* a, const double* b, double* out) const;
};

}  // namespace hemivar
