#include "laws.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace hemivar {

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
// Steps of Newton's method on a piece that is not straight, at most, and what rounding leaves there.
constexpr int kSteps = 200;
constexpr double kSame = 2.0 * std::numeric_limits<double>::epsilon();

struct Pair {
    double first, second;
};

// As NumPy bounds: where a number is none, neither is the answer.
double bounded(double x, double low, double high) {
    if (std::isnan(low) || std::isnan(high)) return low + high;
    x = x < low ? low : x;
    return x > high ? high : x;
}

double both(double x, double y) { return x == 0.0 ? std::fabs(y) : (y == 0.0 ? std::fabs(x) : std::hypot(x, y)); }

double beyond(double x, Pair ends) { return std::max(std::max(ends.first - x, x - ends.second), 0.0); }

// The scalar law of one point.
class Curve {
public:
    Curve(const ScalarLaw& law, int64_t point)
        : numbers_(law.numbers + (law.rows == 1 ? 0 : point * law.length)), pieces_(numbers_ + 3 + 3 * law.knots),
          knots_(law.knots), formula_(law.formula), factor_(law.factor[law.factors == 1 ? 0 : point]) {}

    double lower() const { return numbers_[0]; }
    double upper() const { return numbers_[1]; }
    double inside(double r) const { return bounded(r, lower(), upper()); }
    bool outside(double r) const { return r < lower() || r > upper(); }

    // The piece that holds r; at a knot the one to its left.
    int64_t piece(double r) const {
        int64_t at = 0;
        while (at < knots_ && r > place(at)) ++at;
        return at;
    }
    // Its ends, cut at the domain.
    Pair ends(int64_t piece) const {
        return {inside(piece > 0 ? place(piece - 1) : -kInf), inside(piece < knots_ ? place(piece) : kInf)};
    }
    // Slope and bend of a piece.
    Pair line(int64_t piece, double r) const {
        if (formula_ == ScalarLaw::kStraight) {
            const double* line = pieces_ + 6 * piece;
            return {factor_ * (line[1] + line[2] * (r - line[0])), factor_ * line[2]};
        }
        const Pair found = half(away(piece, r));
        return {factor_ * (piece > 0 ? found.first : -found.first), factor_ * found.second};
    }
    double value(double r) const {
        if (outside(r)) return kInf;
        const int64_t at = piece(r);
        if (formula_ == ScalarLaw::kStraight) {
            const double *line = pieces_ + 6 * at, off = r - line[3];
            return factor_ * (line[5] + line[4] * off + 0.5 * line[2] * (off * off));
        }
        const double s = away(at, r);
        if (formula_ == ScalarLaw::kLogarithmic) return factor_ * std::log1p(s / pieces_[0]);
        return factor_ * (pieces_[1] * s - pieces_[0] / pieces_[2] * std::expm1(-pieces_[2] * s));
    }
    // Whether r is a knot; then the slopes to its left and right, or to those of all knots that coincide there.
    bool at_knot(double r, Pair* sides) const {
        int64_t knot = std::min(piece(r), knots_ - 1);
        if (place(knot) != r || !std::isfinite(r)) return false;
        sides->first = left(knot);
        while (knot + 1 < knots_ && place(knot + 1) <= r) ++knot;
        sides->second = right(knot);
        return true;
    }
    // Ends of the subdifferential; empty outside of the domain.
    Pair slopes(double r) const {
        if (outside(r)) return {kInf, -kInf};
        Pair sides;
        if (at_knot(r, &sides)) return {std::min(sides.first, sides.second), std::max(sides.first, sides.second)};
        const double slope = line(piece(r), r).first;
        return {slope, slope};
    }
    // How far a pair is from the graph: from the law at r, or from a knot that may be meant.
    double distance(double r, double lam, double tau) const {
        double least = beyond(lam, slopes(r));
        for (int64_t k = 0; k < knots_; ++k) {
            const Pair sides{std::min(left(k), right(k)), std::max(left(k), right(k))};
            const double apart = (r - place(k)) / tau;
            if (std::fabs(apart) < least) least = std::min(least, both(apart, beyond(lam, sides)));
        }
        return std::isnan(r) || std::isnan(lam) ? r + lam : least;
    }
    // The minimiser of a/2 r^2 - b r + j(r) into `out`. False where the slope need not grow, or there is none.
    bool minimiser(double a, double b, double* out) const {
        const double alpha = factor_ > 0.0 ? factor_ * numbers_[2] : 0.0;
        if (!(a > alpha || (alpha == 0.0 && a >= 0.0))) return false;
        int64_t piece = 0, reached = 0;
        for (int64_t k = 0; k < knots_ && std::isfinite(place(k)); ++k) {
            piece += b > a * place(k) + right(k);
            reached += b >= a * place(k) + left(k);
        }
        const Pair edge = ends(piece);
        if (piece < reached) {
            *out = edge.second;
        } else if (edge.first < edge.second) {
            *out = formula_ == ScalarLaw::kStraight ? on_line(piece, a, b, edge) : on_curve(piece, a, b);
        } else {
            return false;
        }
        return std::isfinite(*out);
    }

private:
    double place(int64_t knot) const { return numbers_[3 + 3 * knot]; }
    double left(int64_t knot) const { return side(numbers_[4 + 3 * knot]); }
    double right(int64_t knot) const { return side(numbers_[5 + 3 * knot]); }
    double side(double slope) const { return std::isinf(slope) ? slope : factor_ * slope; }
    static double away(int64_t piece, double r) { return std::max(piece > 0 ? r : -r, 0.0); }

    // Slope and bend of a formula at s = |r|.
    Pair half(double s) const {
        if (formula_ == ScalarLaw::kLogarithmic) {
            const double whole = pieces_[0] + s;
            return {1.0 / whole, -1.0 / (whole * whole)};
        }
        const double fall = pieces_[0] * std::exp(-pieces_[2] * s);
        return {pieces_[1] + fall, -pieces_[2] * fall};
    }
    double on_line(int64_t piece, double a, double b, Pair edge) const {
        const double at = std::isfinite(edge.first) ? edge.first : (std::isfinite(edge.second) ? edge.second : 0.0);
        const Pair here = line(piece, at);
        const double room = a + here.second;
        if (!(room > 0.0)) return std::nan("");
        return bounded(at + (b - a * at - here.first) / room, edge.first, edge.second);
    }
    // Even laws push back: the minimiser lies between rest and b / a.
    double on_curve(int64_t piece, double a, double b) const {
        const double sign = piece > 0 ? 1.0 : -1.0, pull = sign * b;
        double low = 0.0, high = pull / a, s = 0.0;
        for (int step = 0; step < kSteps && high < kInf; ++step) {
            const Pair here = half(s);
            const double off = a * s - pull + factor_ * here.first, before = s;
            (off < 0.0 ? low : high) = s;
            s -= off / (a + factor_ * here.second);
            if (!(s >= low && s <= high)) s = 0.5 * (low + high);
            const bool settled = std::fabs(off) <= 0.5 * kSame * (a * before + pull);
            if (settled || std::fabs(s - before) <= kSame * s) return sign * s;
        }
        return std::nan("");
    }

    const double *numbers_, *pieces_;
    int64_t knots_, formula_;
    double factor_;
};

// Length of the slip of a point.
double slip_of(const double* r, int64_t d) {
    if (d == 2) return std::fabs(r[1]);
    double square = 0.0;
    for (int64_t c = 1; c < d; ++c) square += r[c] * r[c];
    return std::sqrt(square);
}

// Part of a vector along the slip of a point, whose length is `size`.
double along(const double* r, double size, const double* lam, int64_t d) {
    double sum = 0.0;
    for (int64_t c = 1; c < d; ++c) sum += r[c] / size * lam[c];
    return sum;
}

}  // namespace

void PointLaw::value(int64_t m, int64_t d, const double* r, double* out) const {
    for (int64_t i = 0; i < m; ++i, r += d) {
        out[i] = Curve(normal, i).value(r[0]);
        if (d > 1) out[i] += Curve(slip, i).value(slip_of(r, d));
    }
}

void PointLaw::linearise(int64_t m, int64_t d, const double* r, uint8_t* smooth, double* gradient,
                         double* hessian) const {
    std::fill_n(hessian, m * d * d, 0.0);
    std::fill_n(gradient, m * d, 0.0);
    std::fill_n(smooth, 2 * m, uint8_t{0});
    const auto bends = [](const Curve& law, double at, Pair* line) {
        Pair sides;
        if (law.at_knot(at, &sides) && sides.first != sides.second) return false;
        *line = law.line(law.piece(at), at);
        return true;
    };
    for (int64_t i = 0; i < m; ++i, r += d, gradient += d, hessian += d * d, smooth += 2) {
        Pair line;
        if (bends(Curve(normal, i), r[0], &line)) {
            smooth[0] = 1;
            gradient[0] = line.first;
            hessian[0] = line.second;
        }
        if (d == 1) continue;
        const double size = slip_of(r, d);
        if (!bends(Curve(slip, i), size, &line)) continue;
        smooth[1] = 1;
        const double across = size > 0.0 ? line.first / size : line.second, unit = size > 0.0 ? size : 1.0;
        for (int64_t c = 1; c < d; ++c) {
            gradient[c] = line.first * (r[c] / unit);
            for (int64_t e = 1; e < d; ++e) {
                const double outer = r[c] / unit * (r[e] / unit);
                hessian[c * d + e] = across * ((c == e ? 1.0 : 0.0) - outer) + line.second * outer;
            }
        }
    }
}

void PointLaw::nearest(int64_t m, int64_t d, const double* r, const double* lam, double* out) const {
    for (int64_t i = 0; i < m; ++i, r += d, lam += d, out += d) {
        const Curve own(normal, i);
        const Pair ends = own.slopes(own.inside(r[0]));
        out[0] = bounded(lam[0], ends.first, ends.second);
        if (d == 1) continue;
        const Curve rubs(slip, i);
        const double size = slip_of(r, d), force = slip_of(lam, d);
        const Pair friction = rubs.slopes(size > rubs.upper() ? rubs.upper() : size);
        const double rest = bounded(force, 0.0, std::max(friction.second, 0.0));
        const double length = size > 0.0 ? bounded(along(r, size, lam, d), friction.first, friction.second) : rest;
        const double *way = size > 0.0 ? r : lam, unit = size > 0.0 ? size : (force > 0.0 ? force : 1.0);
        for (int64_t c = 1; c < d; ++c) out[c] = length * (way[c] / unit);
    }
}

void PointLaw::clamp(int64_t m, int64_t d, const double* start, const double* end, double* out) const {
    for (int64_t i = 0; i < m; ++i, start += d, end += d, out += d) {
        const Curve own(normal, i);
        const Pair edge = own.ends(own.piece(start[0]));
        out[0] = bounded(end[0], edge.first, edge.second);
        if (d == 1) continue;
        const Curve rubs(slip, i);
        const double size = slip_of(start, d), length = slip_of(end, d);
        const Pair far = rubs.ends(rubs.piece(size));
        const bool forwards = along(start, 1.0, end, d) > 0.0;
        const double *way = forwards ? end : start, unit = forwards ? length : (size > 0.0 ? size : 1.0);
        const double reach = forwards ? bounded(length, far.first, far.second) : std::max(far.first, 0.0);
        for (int64_t c = 1; c < d; ++c) out[c] = reach * (way[c] / unit);
    }
}

void PointLaw::distance(int64_t m, int64_t d, const double* r, const double* lam, const double* tau,
                        double* out) const {
    for (int64_t i = 0; i < m; ++i, r += d, lam += d, tau += 2) {
        out[i] = Curve(normal, i).distance(r[0], lam[0], tau[0]);
        if (d == 1) continue;
        const Curve rubs(slip, i);
        const double size = slip_of(r, d), force = slip_of(lam, d);
        double least = both(size / tau[1], beyond(force, rubs.slopes(0.0)));
        if (size > 0.0) {
            const double pull = along(r, size, lam, d);
            double aside = 0.0;
            for (int64_t c = 1; c < d; ++c) aside = both(aside, lam[c] - pull * (r[c] / size));
            least = std::min(least, both(rubs.distance(size, pull, tau[1]), d > 2 ? aside : 0.0));
        }
        out[i] = std::isnan(size + force) ? size + force : both(out[i], least);
    }
}

bool PointLaw::minimise(int64_t m, int64_t d, const double* a, const double* b, double* out) const {
    for (int64_t i = 0; i < m; ++i, a += 2, b += d, out += d) {
        if (!Curve(normal, i).minimiser(a[0], b[0], out)) return false;
        if (d == 1) continue;
        const double pull = slip_of(b, d);
        double length;
        if (!Curve(slip, i).minimiser(a[1], pull, &length)) return false;
        for (int64_t c = 1; c < d; ++c) {
            out[c] = std::fabs(length) * (pull > 0.0 ? b[c] / pull : (c == 1 ? 1.0 : 0.0));
        }
    }
    return true;
}

}  // namespace hemivar
