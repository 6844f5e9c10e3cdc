// Why an iteration does not settle: a participant whose answer jumps, at a motion that the iteration has to
// pass, has no fixed point there, and no acceleration finds one.
#pragma once

#include <functional>
#include <optional>

#include "interface_state.hpp"

namespace estuary::coupler {

/// Two motions close together and how far apart their answers are.
struct AnswerJump {
  double distance = 0;      // of the motions, L2 over the wet nodes [m]
  double displacement = 0;  // change of the answers, as shares of the answers
  double velocity = 0;
  double forces = 0;
};

using Answer = std::function<InterfaceState(const InterfaceState& motion)>;
/// Replaces the motion by the next iterate.
using NextIterate = std::function<void(InterfaceState& motion, const InterfaceState& answer)>;

/// Iterates ten times more from `x` and takes the two iterates in a row between which the answer changes most
/// for their distance; then halves the way between them 20 times, each time on to the half over which the
/// answer changes more. A jump: over a millionth of the way it still changes by a tenth of what it changes
/// over all of it, and by more than a hundred-thousandth of itself, which is no rounding. A steep but
/// continuous answer is none, nor has an iteration a jump that only needs those ten more. `answer_calls`
/// calls of `answer` at most.
inline constexpr int answer_calls = 30;
std::optional<AnswerJump> find_jump(InterfaceState x, const Answer& answer, const NextIterate& next);

}  // namespace estuary::coupler
