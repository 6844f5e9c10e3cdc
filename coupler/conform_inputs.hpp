// What a participant under examination is given: the surface and grains that the scene's other participants
// bring, small inputs of the right shape, and inputs that are wrong in one way each.
#pragma once

#include <atomic>
#include <filesystem>
#include <string>
#include <vector>

#include "estuary/v1/protocol.pb.h"
#include "plan.hpp"

namespace estuary::coupler {

/// Launches the solid and the grains of the scene, as far as `role` needs what they bring, up to their Start,
/// and stops them. Throws RunFailure.
v1::Exchange what_others_bring(const CheckedScene& scene, const std::string& role,
                               const std::filesystem::path& folder, const std::atomic<int>& interrupt);

/// A participant's surroundings, small enough to compute with and different enough to tell apart.
class ConformInputs {
public:
  /// `initial` went into Start, `brought` came back. `pressure` [Pa] loads a solid.
  ConformInputs(const CouplingScene& scene, std::string role, v1::Exchange initial, v1::Exchange brought,
                double pressure);

  /// Each `variant` gives other values; 0 gives zero forces, or no motion.
  [[nodiscard]] v1::Exchange inputs(int variant) const;
  /// Whether the participant has inputs at all.
  [[nodiscard]] bool any() const { return inputs(1).ByteSizeLong() > 0; }
  /// Empty when `outputs` holds every field that the scene asks for, of the right length, surface and finite;
  /// else what is wrong.
  [[nodiscard]] std::string fault_of(const v1::Exchange& outputs) const;

private:
  [[nodiscard]] bool has(const char* other) const { return scene_.find(other) != nullptr && role_ != other; }
  [[nodiscard]] const v1::WetSurface& surface() const;

  const CouplingScene& scene_;
  std::string role_;
  v1::Exchange initial_;
  v1::Exchange brought_;
  double pressure_;
};

/// A message that has to be refused, and in what it is wrong.
struct WrongExchange {
  std::string what;
  v1::Exchange exchange;
};
/// For every field of `right`: absent, not finite, of wrong length, of another surface.
[[nodiscard]] std::vector<WrongExchange> wrong_fields(const v1::Exchange& right);
/// The same for the wet surface in it: a position that is not finite, a facet of no node, another dimension.
[[nodiscard]] std::vector<WrongExchange> wrong_surfaces(const v1::Exchange& right);

}  // namespace estuary::coupler
