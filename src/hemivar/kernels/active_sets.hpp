// Primal-dual active set rounds on a small condensed body (Schur complement), the law of each component in tables.
#pragma once

#include <cstdint>
#include <vector>

namespace hemivar {

// A law of each of n components: pieces (even) and kinks (odd) in turn, `states` of them. The tables have one row a
// state. What they point to stays with the caller.
struct Tables {
    int64_t n, states;
    const double *stiffness;  // that sorts, (n,)
    const double *bounds;     // from which on a component is in the next state, (states - 1, n)
    const double *anchor, *base, *slope;  // base + slope (r - anchor); the anchor of a kink is the kink
    const double *knots, *low, *high;     // kinks, inf where there is none, and the ends there, (states / 2, n)
    const double *first, *last;           // ends of the domain, (n,)
    // Where friction is bounded by a multiple of the pressure: that multiple of each point, (n / 2,), components being
    // penetration and slip in turn and the tables of slip those of the bound 1; else null.
    const double* coefficient;
};

class ActiveSets {
public:
    enum End { kOpen = 0, kClose = 1, kGivenUp = 2 };

    // matrix (n, n), symmetric; weights and compliance (n,).
    ActiveSets(const Tables& law, const double* matrix, const double* weights, const double* compliance)
        : law_(law), matrix_(matrix), weights_(weights), compliance_(compliance), state_(law.n), known_(law.n, -1), pivots_(law.n),
          law_force_(law.n), balance_(law.n), step_(law.n), slope_(law.n), pushed_(law.n),
          factor_(law.n * law.n) {}

    // Rounds from the pair (r, lam), at most `most`, until the multiplier of the body misses that of the law by no more
    // than `atol + rtol max(load, force)`. In r, lam and of_law the last pair and what the law says there; in `told`
    // the number of rounds, by how much it is missed, and the force of the law.
    End run(const double* load, double* r, double* lam, double* of_law, int64_t most, double atol, double rtol,
            double load_size, double* told);

    // Norm of the weighted distances of pairs to the graphs of their laws, in units of lam; compliance makes r such.
    double distance(const double* r, const double* lam);

private:
    bool follows(int64_t i) const { return law_.coefficient && i % 2; }
    double bound(int64_t i, double pressure) const;
    int64_t state_of(int64_t i, double pull, double most) const;
    void onto(double* r, const double* lam);
    bool same() const;
    bool factorise();
    bool factorise_following();
    void solve(double* x) const;
    void solve_following(double* x) const;

    Tables law_;
    const double *matrix_, *weights_, *compliance_;
    std::vector<int64_t> state_, known_, free_, pivots_;  // known_: those that the factor belongs to
    std::vector<double> law_force_, balance_, step_;
    // second derivatives of the laws, and by how much friction follows the pressure of its point
    std::vector<double> slope_, pushed_, known_slope_, known_pushed_, factor_;
};

}  // namespace hemivar
