#include "convergence.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>

namespace estuary::coupler {
namespace {

// A displacement this many times the size of the wet surface is no solution of anything.
constexpr double absurd_displacement = 1e3;
// An increment that grew this much over the window's first few belongs to a diverging iteration.
constexpr double diverging_growth = 1e6;
constexpr std::uint64_t early_iterations = 3;
// Velocities and forces below this share of the largest so far need no relative accuracy: the surface is
// turning round, the load changes its sign or dies away.
constexpr double small_share = 1e-2;
// Displacements below this share of the surface's size count as zero, and so do their changes: positions,
// and with them all that a fluid makes of them, are known no better.
constexpr double zero_displacement = 1e-14;
// This many iterations in a row without any gain is a stall.
constexpr std::uint64_t stalling_iterations = 50;
// Explicit windows in a row whose mismatch grows beyond the motion itself.
constexpr int runaway_windows = 4;
constexpr double least_gain = 0.99;

}  // namespace

Convergence::Convergence(const CouplingScene& scene, double displacement_scale)
    : measures_(scene.measures),
      least_iterations_(static_cast<std::uint64_t>(scene.min_iterations)),
      scale_(displacement_scale),
      window_(scene.window) {}

void Convergence::begin_window() {
  best_displacement_ = std::numeric_limits<double>::infinity();
  best_force_ = best_displacement_;
  best_at_ = 0;
  judged_ = 0;
  early_increment_ = 0;
}

double Convergence::relative(Field field) const {
  const Norm& norm = of(field);
  if (norm.increment == 0) return 0;
  switch (field) {
    case Field::displacement: {
      const double nothing = zero_displacement * scale_;
      return norm.increment <= nothing ? 0 : norm.increment / std::max(norm.size, nothing);
    }
    case Field::velocity: {
      const double nothing = zero_displacement * scale_ / std::max(window_, 1e-300);
      if (norm.increment <= nothing) return 0;
      return norm.increment / std::max({norm.size, small_share * largest_velocity_, nothing});
    }
    case Field::force:
      break;
  }
  const double size = std::max(norm.size, small_share * largest_force_);
  return size > 0 ? norm.increment / size : 1.0;
}

double Convergence::value_of(const Measure& measure) const {
  const Norm& norm = of(measure.field);
  switch (measure.kind) {
    case MeasureKind::relative:
      break;
    case MeasureKind::absolute:
      return norm.increment;
    case MeasureKind::residual_relative:
      return norm.first_increment > 0 ? norm.increment / norm.first_increment : 0.0;
  }
  return relative(measure.field);
}

std::string Convergence::furthest() const {
  const Measure* worst = nullptr;
  double most = -1;
  for (const Measure& measure : measures_) {
    const double share = value_of(measure) / measure.limit;
    if (!(share > most)) continue;
    most = share;
    worst = &measure;
  }
  if (worst == nullptr) return "nothing is measured";
  constexpr std::array<const char*, 3> fields = {"displacement", "velocity", "forces"};
  constexpr std::array<const char*, 3> kinds = {"relative", "absolute", "residual-relative"};
  return fmt::format("{} increment of the {} {:.1e}, limit {:g}",
                     kinds[static_cast<std::size_t>(worst->kind)],
                     fields[static_cast<std::size_t>(worst->field)], value_of(*worst), worst->limit);
}

bool Convergence::grows(const IterationNorms& norms) const {
  const double first = std::max(early_increment_, 1e-12 * scale_);
  return norms.displacement > absurd_displacement * scale_ ||
         norms.displacement_increment > diverging_growth * first;
}

Verdict Convergence::judge(const IterationNorms& norms, std::uint64_t iteration) {
  const auto set = [&](Field field, double increment, double size) {
    Norm& norm = fields_[static_cast<std::size_t>(field)];
    norm.increment = increment;
    norm.size = size;
    if (judged_ == 0) norm.first_increment = increment;
  };
  set(Field::displacement, norms.displacement_increment, norms.displacement);
  set(Field::velocity, norms.velocity_increment, norms.velocity);
  set(Field::force, norms.force_increment, norms.force);
  // In a parallel scheme the first answers belong to no load at all.
  if (++judged_ <= early_iterations)
    early_increment_ = std::max(early_increment_, norms.displacement_increment);
  if (grows(norms)) return Verdict::diverged;
  if (iteration >= least_iterations_ &&
      std::all_of(measures_.begin(), measures_.end(), [this](const Measure& m) {
        // An iteration without any change is at its end, whatever it is compared with.
        return value_of(m) < m.limit || of(m.field).increment == 0;
      })) {
    return Verdict::converged;
  }
  const auto gains = [](double increment, double& best) {
    if (!(increment < least_gain * best)) return false;
    best = increment;
    return true;
  };
  const bool displacement_gains = gains(norms.displacement_increment, best_displacement_);
  const bool force_gains = gains(norms.force_increment, best_force_);
  if (displacement_gains || force_gains) best_at_ = iteration;
  return iteration >= best_at_ + stalling_iterations ? Verdict::stalled : Verdict::go_on;
}

bool Convergence::runs_away(const IterationNorms& norms) {
  const bool grows = norms.velocity_increment > norms.velocity && norms.velocity_increment > last_mismatch_;
  mismatches_ = grows ? mismatches_ + 1 : 0;
  last_mismatch_ = norms.velocity_increment;
  return mismatches_ >= runaway_windows;
}

void Convergence::accept(const IterationNorms& norms) {
  largest_velocity_ = std::max(largest_velocity_, norms.velocity);
  largest_force_ = std::max(largest_force_, norms.force);
}

void Convergence::save(StateWriter& state) const {
  state.number(largest_velocity_);
  state.number(largest_force_);
  state.number(last_mismatch_);
  state.count(static_cast<std::size_t>(mismatches_));
}

void Convergence::load(StateReader& state) {
  largest_velocity_ = state.number();
  largest_force_ = state.number();
  last_mismatch_ = state.number();
  mismatches_ = static_cast<int>(state.count());
}

}  // namespace estuary::coupler
