// Links of shells that break.
#include <algorithm>
#include <cmath>
#include <limits>

#include "shell_row.hpp"
#include "solver.hpp"

namespace estuary::solid {

// The largest ratio of what a link bears to its limit; 0 of a broken one.
double ShellRow::overload(std::span<const double> history, std::size_t l) const {
  const ShellSection& section = sections_[links_[l].member];
  const RuptureLimits& limit = section.rupture;
  if (!limit.any() || broken(history, l)) return 0;
  if (at_[l].folded) return std::numeric_limits<double>::max();
  const double* own = memory(history, l);
  double worst = 0;
  const auto compare = [&](double value, double bound) {
    if (bound > 0) worst = std::max(worst, value / bound);
  };
  compare(at_[l].stretch - 1, limit.stretch);
  compare(std::abs(at_[l].shear_strain), limit.shear);
  compare(own[3], limit.plastic_strain);
  compare(at_[l].stored + links_[l].length * own[5], limit.energy * section.thickness);
  return worst;
}

std::size_t ShellRow::break_links(std::span<double> history) {
  std::vector<std::size_t> chosen;
  for (std::size_t l = 0; breakable_ && l < links_.size(); ++l) {
    const double own = overload(history, l);
    if (!(own > 1)) continue;
    // Of neighbours past their limits only the worst breaks in a step: it unloads the others.
    const std::uint32_t before = before_[links_[l].a], after = after_[links_[l].b];
    if (before != kNone && overload(history, before) >= own) continue;
    if (after != kNone && overload(history, after) > own) continue;
    chosen.push_back(l);
  }
  for (const std::size_t l : chosen) {
    double* own = &history[2 * size() + kLinkHistory * l];
    own[kSectionHistory] = 1;
    own[kSectionHistory + 1] = at_[l].stored;
  }
  return chosen.size();
}

void ShellRow::refuse_folded(std::uint64_t step) const {
  if (folded_ == 0) return;
  for (std::size_t l = 0; l < links_.size(); ++l)
    if (at_[l].folded && !sections_[links_[l].member].rupture.any())
      throw Breakdown(
          particle_[links_[l].a], step, "rotation",
          "begins a link of a shell that has folded (its fibres lie along it, not across)",
          "use shorter links (spacing), which share a hinge's angle, a smaller load or courant, or "
          "[solid] rupture, by which such a link breaks");
}

std::vector<std::array<std::uint32_t, 2>> ShellRow::broken_links(std::span<const double> history) const {
  std::vector<std::array<std::uint32_t, 2>> result;
  for (std::size_t l = 0; l < links_.size(); ++l)
    if (broken(history, l)) result.push_back({particle_[links_[l].a], particle_[links_[l].b]});
  return result;
}

void ShellRow::drop_broken(std::span<const double> history, Loading& loading) const {
  const auto gone = [&](const std::array<std::uint32_t, 2>& segment) {
    const std::uint32_t a = local_[segment[0]], b = local_[segment[1]];
    if (a == kNone || b == kNone) return false;
    const std::uint32_t l = after_[a];
    return l != kNone && links_[l].b == b && broken(history, l);
  };
  for (TractionLoad& load : loading.tractions) std::erase_if(load.segment, gone);
  for (PressureLoad& load : loading.pressures) std::erase_if(load.segment, gone);
}

double ShellRow::fracture_work(std::span<const double> history) const {
  double sum = 0;
  for (std::size_t l = 0; breakable_ && l < links_.size(); ++l)
    sum += memory(history, l)[kSectionHistory + 1];
  return sum;
}

std::array<double, 4> ShellRow::losses(std::span<const double> history) const {
  std::array<double, 4> result{};
  for (std::size_t l = 0; l < links_.size(); ++l) {
    if (!broken(history, l)) continue;
    const double* own = memory(history, l);
    result[0] += 1;
    result[3] += links_[l].length * own[5] + own[kSectionHistory + 1];
  }
  for (const std::uint32_t i : isolated(history)) {
    result[1] += 1;
    result[2] += body_.mass[i];
  }
  return result;
}

std::vector<std::uint32_t> ShellRow::isolated(std::span<const double> history) const {
  std::vector<std::uint32_t> result;
  if (!breakable_) return result;
  for (std::size_t i = 0; i < size(); ++i) {
    const auto holds = [&](std::uint32_t l) { return l != kNone && !broken(history, l); };
    if (!holds(before_[i]) && !holds(after_[i])) result.push_back(particle_[i]);
  }
  return result;
}

}  // namespace estuary::solid
