#include "shell_section.hpp"

#include <algorithm>
#include <cmath>

namespace estuary::solid {
namespace {

const double kCross = 1 / std::sqrt(3.0);

// A root of a function that is not negative at `low` and not positive at `high`: regula falsi with the
// Illinois rule.
template <class Function>
double root(Function&& f, double low, double at_low, double high, double at_high, double tolerance) {
  int side = 0;
  double x = high;
  for (int iteration = 0; iteration < 80 && at_low != at_high; ++iteration) {
    x = (low * at_high - high * at_low) / (at_high - at_low);
    if (!(x > low && x < high)) break;
    const double value = f(x);
    if (std::abs(value) <= tolerance) break;
    if (value > 0) {
      low = x;
      at_low = value;
      if (side > 0) at_high *= 0.5;
      side = 1;
    } else {
      high = x;
      at_high = value;
      if (side < 0) at_low *= 0.5;
      side = -1;
    }
  }
  return x;
}

// The return to the yield surface at one psi.
struct Return {
  const ShellSection* section;
  SectionVector trial;
  double alpha;  // equivalent plastic strain at the start
  double a, b, t;
  SectionVector now;
  double multiplier = 0, equivalent = 0;

  Return(const ShellSection& of, const SectionVector& from, double strain, double psi)
      : section(&of),
        trial(from),
        alpha(strain),
        a(1 / (of.plane_factor * of.thickness)),
        b(6 / (of.plane_factor * psi * of.thickness * of.thickness)),
        t(std::sqrt(3 * of.shear_weight) / of.thickness),
        now(from) {
    equivalent = size(now);
  }

  [[nodiscard]] double size(const SectionVector& s) const {
    const double x = a * s.membrane, y = b * s.bending, z = t * s.shear;
    return std::sqrt(x * x + y * y + kCross * std::abs(x * y) + z * z);
  }
  [[nodiscard]] double strain() const { return alpha + multiplier * equivalent / section->thickness; }
  [[nodiscard]] double excess() const {
    double slope = 0;
    return equivalent - section->plasticity.at(strain(), slope);
  }
  // The state on the way back for a plastic multiplier over the equivalent stress; where the return would
  // cross the kink of the yield surface at no force or no moment, it stays on it.
  double at(double mu) {
    multiplier = mu;
    const double stiff_n = section->membrane(), stiff_m = section->bending();
    const double sign = trial.membrane * trial.bending < 0 ? -1.0 : 1.0;
    const double cross = 0.5 * sign * kCross * a * b * mu;
    const double nn = 1 + mu * stiff_n * a * a, mm = 1 + mu * stiff_m * b * b;
    const double determinant = nn * mm - stiff_n * stiff_m * cross * cross;
    now.membrane = (mm * trial.membrane - stiff_n * cross * trial.bending) / determinant;
    now.bending = (nn * trial.bending - stiff_m * cross * trial.membrane) / determinant;
    if (now.membrane * trial.membrane <= 0) {
      now.membrane = 0;
      now.bending = trial.bending / mm;
    } else if (now.bending * trial.bending <= 0) {
      now.bending = 0;
      now.membrane = trial.membrane / nn;
    }
    now.shear = trial.shear / (1 + mu * section->shear() * t * t);
    equivalent = size(now);
    return excess();
  }
  void solve() {
    const double first = excess();
    if (!(first > 0)) return;
    const double softest = std::min(section->membrane() * a * a, section->bending() * b * b);
    double high = first / (equivalent - first) / softest, value = at(high);
    for (int doubling = 0; value > 0 && doubling < 200; ++doubling) value = at(high *= 2);
    const double tolerance = 1e-12 * (equivalent + first);
    if (value < -tolerance) at(root([&](double mu) { return at(mu); }, 0, first, high, value, tolerance));
  }
  [[nodiscard]] double plastic_curvature() const {
    return (trial.bending - now.bending) / section->bending();
  }
};

double first_yield_curvature(const ShellSection& section) {
  return 2 * section.plane_factor * section.plasticity.yield.front() /
         (section.young_modulus * section.thickness);
}

}  // namespace

double hinge_parameter(Hinge hinge, double plastic_curvature) {
  if (hinge == Hinge::skin) return 1;
  if (hinge == Hinge::section) return 1.5;
  double k = plastic_curvature + 1.5;  // right of the root of a convex function
  for (int iteration = 0; iteration < 60; ++iteration) {
    const double cube = k * k * k;
    const double step = (k - 1.5 + 0.5 / (k * k) - plastic_curvature) / std::max(1 - 1 / cube, 1e-12);
    k = std::max(1.0, k - step);
    if (std::abs(step) <= 1e-14 * k) break;
  }
  return 1.5 - 0.5 / (k * k);
}

double limit_moment(const ShellSection& section) {
  return section.plane_factor * section.plasticity.yield.front() * section.thickness * section.thickness *
         hinge_parameter(section.hinge, 1e300) / 6;
}

SectionAnswer flow(const ShellSection& section, const SectionVector& strain, const double* history,
                   double* next) {
  const SectionVector trial{section.membrane() * (strain.membrane - history[0]),
                            section.shear() * (strain.shear - history[1]),
                            section.bending() * (strain.bending - history[2])};
  const double psi = hinge_parameter(section.hinge, history[4]);
  Return back(section, trial, history[3], psi);
  double turned = 0;  // plastic curvature of the increment over that at first yield
  if (back.excess() > 0) {
    back.solve();
    const double unit = first_yield_curvature(section);
    if (section.hinge == Hinge::growing) {
      // psi of the increment's end, which depends on what flows.
      const auto gap = [&](double guess) {
        back = Return(section, trial, history[3], guess);
        back.solve();
        return hinge_parameter(section.hinge, history[4] + std::abs(back.plastic_curvature()) / unit) - guess;
      };
      const double at_low = gap(psi);
      if (at_low > 1e-13) {
        const double at_high = gap(1.5);
        if (at_high < 0) gap(root(gap, psi, at_low, 1.5, at_high, 1e-13));
      }
    }
    turned = std::abs(back.plastic_curvature()) / unit;
  }
  const SectionVector& s = back.now;
  SectionAnswer answer;
  answer.resultant = s;
  answer.stored = 0.5 * (s.membrane * s.membrane / section.membrane() + s.shear * s.shear / section.shear() +
                         s.bending * s.bending / section.bending());
  const double increment[3] = {(trial.membrane - s.membrane) / section.membrane(),
                               (trial.shear - s.shear) / section.shear(),
                               (trial.bending - s.bending) / section.bending()};
  if (back.multiplier > 0) {
    // What does the work is on the way from the yield surface of the start to that of the end: the mean of
    // both along the resultants of the end, which is exact for linear hardening and else of second order.
    const Return first(section, s, history[3], psi);
    answer.dissipated = (1 - 0.5 * first.excess() / first.equivalent) *
                        (s.membrane * increment[0] + s.shear * increment[1] + s.bending * increment[2]);
  }
  if (next != nullptr) {
    for (std::size_t k = 0; k < 3; ++k) next[k] = history[k] + increment[k];
    next[3] = back.strain();
    next[4] = history[4] + turned;
    next[5] = history[5] + answer.dissipated;
  }
  return answer;
}

}  // namespace estuary::solid
