// Flows whose steps are timed.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "flow.hpp"

namespace estuary::fluid::speed {

/// A flow, and how it is stepped.
struct Case {
  explicit Case(const FlowSettings& settings) : flow(settings) {}
  Case(const Case&) = delete;
  Case& operator=(const Case&) = delete;
  virtual ~Case() = default;
  virtual void run(int steps) { flow.run(static_cast<std::size_t>(steps)); }
  Flow flow;
};

/// Two cases whose speeds are compared.
struct Ratio {
  std::string one;
  std::string other;
  const char* meaning;
};

/// A box with a sliding lid, or a channel from a velocity to a pressure side; nz = 0: in the plane.
[[nodiscard]] FlowSettings cavity(int nx, int ny, int nz = 0);
[[nodiscard]] FlowSettings channel(int nx, int ny);
/// Overlapping discs (spheres) of `radius` at random until the share `solid` is covered; one entry per node.
[[nodiscard]] std::vector<std::uint16_t> packing(const Grid& grid, int radius, double solid);

/// Name, and what makes it.
[[nodiscard]] std::vector<std::pair<std::string, std::function<std::shared_ptr<Case>()>>> cases();
[[nodiscard]] std::vector<Ratio> ratios();

}  // namespace estuary::fluid::speed
