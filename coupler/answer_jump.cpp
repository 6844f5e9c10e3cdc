#include "answer_jump.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace estuary::coupler {
namespace {

constexpr int more_iterations = 10;
constexpr int halvings = answer_calls - more_iterations;
// Of an answer; numbers stored in single precision are rounded by 1e-7.
constexpr double rounding = 1e-5;

double share(const std::vector<double>& a, const std::vector<double>& b) {
  const double size = std::max(l2_norm(a), l2_norm(b));
  return size > 0 ? l2_distance(a, b) / size : 0;
}

// Of two answers; forces and velocity, since a window's displacement hardly depends on its load.
double difference(const InterfaceState& a, const InterfaceState& b) {
  return share(a.forces, b.forces) + share(a.motion.velocity, b.motion.velocity);
}

std::vector<double> mean(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> result(a.size());
  for (std::size_t i = 0; i < a.size(); ++i) result[i] = 0.5 * (a[i] + b[i]);
  return result;
}

struct Asked {
  InterfaceState motion, answer;
};

double distance(const Asked& a, const Asked& b) {
  return l2_distance(a.motion.motion.displacement, b.motion.motion.displacement);
}

InterfaceState middle_of(const InterfaceState& a, const InterfaceState& b) {
  return {{mean(a.motion.displacement, b.motion.displacement), mean(a.motion.velocity, b.motion.velocity)},
          mean(a.forces, b.forces)};
}

}  // namespace

std::optional<AnswerJump> find_jump(InterfaceState x, const Answer& answer, const NextIterate& next) {
  std::vector<Asked> asked;
  std::size_t steepest = 0;  // of the pairs, the second
  double slope = 0;
  for (int k = 0; k < more_iterations; ++k) {
    asked.push_back({x, answer(x)});
    next(x, asked.back().answer);
    if (k == 0) continue;
    const Asked &a = asked[asked.size() - 2], &b = asked.back();
    const double way = distance(a, b);
    const double change = difference(a.answer, b.answer);
    if (way > 0 && change > rounding && change / way > slope) {
      slope = change / way;
      steepest = asked.size() - 1;
    }
  }
  const bool settled = difference(asked[asked.size() - 2].answer, asked.back().answer) <= rounding;
  if (steepest == 0 || settled) return std::nullopt;
  Asked a = std::move(asked[steepest - 1]), b = std::move(asked[steepest]);
  const double whole = difference(a.answer, b.answer);
  for (int k = 0; k < halvings; ++k) {
    Asked middle{middle_of(a.motion, b.motion), {}};
    middle.answer = answer(middle.motion);
    const bool nearer = difference(a.answer, middle.answer) > difference(middle.answer, b.answer);
    (nearer ? b : a) = std::move(middle);
  }
  if (!(difference(a.answer, b.answer) > std::max(0.1 * whole, rounding))) return std::nullopt;
  return AnswerJump{.distance = distance(a, b),
                    .displacement = share(a.answer.motion.displacement, b.answer.motion.displacement),
                    .velocity = share(a.answer.motion.velocity, b.answer.motion.velocity),
                    .forces = share(a.answer.forces, b.answer.forces)};
}

}  // namespace estuary::coupler
