// Limits and orders of ladders of resolutions.
#pragma once

#include <optional>
#include <vector>

namespace estuary::coupler {

/// Where a ladder goes: f(h) = value + C h^order through its three finest steps.
struct LadderLimit {
  double value = 0;
  double order = 0;
  bool extrapolated = false;  // else `value` is that of the finest step: the ladder gives no order
};

/// `sizes` fall strictly, `values` belong to them; with `order` given two steps are enough. Richardson
/// (1911), for ratios of sizes that need not be the same. Without at least one step, or where the differences
/// change their sign or give an order outside 0.3 to 10, nothing is extrapolated.
LadderLimit ladder_limit(const std::vector<double>& sizes, const std::vector<double>& values,
                         std::optional<double> order);

/// Slope of log(error) over log(size) by least squares over all steps with a positive error; nothing with
/// less than two such steps.
std::optional<double> observed_order(const std::vector<double>& sizes, const std::vector<double>& errors);

}  // namespace estuary::coupler
