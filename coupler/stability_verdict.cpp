#include "stability_verdict.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

namespace estuary::coupler {
namespace {

bool says(const std::string& message, std::initializer_list<std::string_view> words) {
  return std::any_of(words.begin(), words.end(),
                     [&](std::string_view word) { return message.find(word) != std::string::npos; });
}

/// The number after "window " in a line that says where a run ended.
std::optional<std::uint64_t> window_in(const std::string& message) {
  constexpr std::string_view word = "window ";
  const auto at = message.find(word);
  if (at == std::string::npos) return std::nullopt;
  std::uint64_t window = 0;
  const auto* begin = message.data() + at + word.size();
  const auto [stop, error] = std::from_chars(begin, message.data() + message.size(), window);
  return error == std::errc{} && stop != begin ? std::optional(window) : std::nullopt;
}

/// How far beyond its bounds a value is, relative to the bound (to `scale` when given); 0 within.
double excess(const StudyQuantity& quantity, double value) {
  double beyond = 0;
  const auto compare = [&](double distance, double bound) {
    const double scale = quantity.scale.value_or(std::abs(bound));
    if (distance > 0) beyond = std::max(beyond, scale > 0 ? distance / scale : INFINITY);
  };
  if (quantity.at_most) compare(value - *quantity.at_most, *quantity.at_most);
  if (quantity.at_least) compare(*quantity.at_least - value, *quantity.at_least);
  return beyond;
}

bool has_reference(const StudyQuantity& quantity) {
  return quantity.reference || quantity.other || quantity.exact;
}

StabilityVerdict verdict_of_finished(const std::vector<StudyQuantity>& quantities,
                                     const StudyResult& result) {
  StabilityVerdict verdict{
      .kind = StabilityClass::stable, .lie = false, .symptom = {}, .window = {}, .time = {}};
  for (std::size_t k = 0; k < quantities.size(); ++k) {
    const StudyQuantity& quantity = quantities[k];
    const QuantityResult& found = result.quantities[k];
    std::string symptom;
    bool lie = false;
    if (!std::isfinite(found.value)) {
      symptom = fmt::format("{} is missing or not finite", quantity.name);
      lie = true;
    } else if (has_reference(quantity) && !(found.error <= quantity.tolerance)) {
      symptom = fmt::format("{} = {:.4g} instead of {:.4g}", quantity.name, found.value, found.reference);
      lie = !(found.error <= quantity.lie);
    } else if (const double beyond = excess(quantity, found.value); beyond > 0) {
      symptom = fmt::format("{} = {:.4g} is beyond its bound", quantity.name, found.value);
      lie = beyond > quantity.lie;
    }
    if (symptom.empty()) continue;
    verdict.kind = StabilityClass::inaccurate;
    // A check of the scene that fails says nothing: its reference is that of the scene as it stands, without
    // the study's settings.
    verdict.lie = verdict.lie || (lie && result.warnings.empty());
    verdict.symptom += (verdict.symptom.empty() ? "" : "; ") + symptom;
  }
  return verdict;
}

}  // namespace

const char* class_name(StabilityClass kind) {
  switch (kind) {
    case StabilityClass::stable:
      return "stable";
    case StabilityClass::inaccurate:
      return "inaccurate";
    case StabilityClass::stalled:
      return "stalled";
    case StabilityClass::diverged:
      return "diverged";
    case StabilityClass::lost:
      return "lost";
    case StabilityClass::refused:
      return "refused";
    case StabilityClass::not_run:
      break;
  }
  return "not run";
}

StabilityVerdict stability_verdict(const std::vector<StudyQuantity>& quantities, const StudyResult& result,
                                   const CouplingScene& scene) {
  if (result.status == "not run") return {};
  if (result.finished) return verdict_of_finished(quantities, result);
  StabilityVerdict verdict;
  verdict.symptom = result.message;
  if (result.status == "refused" || result.status == "wrong scene") {
    verdict.kind = StabilityClass::refused;
    return verdict;
  }
  const bool grew = says(result.message, {"diverge", "not finite"});
  const bool stood = !grew && says(result.message, {"stalled", "not converge", "no longer", "not steady"});
  if (result.status == "time limit" || (result.status == "diverged or not converged" && stood)) {
    verdict.kind = StabilityClass::stalled;
  } else {
    verdict.kind =
        result.status == "diverged or not converged" ? StabilityClass::diverged : StabilityClass::lost;
  }
  verdict.window = window_in(result.message);
  if (scene.mode == CouplingMode::transient && verdict.window)
    verdict.time = static_cast<double>(*verdict.window) * scene.window;
  return verdict;
}

}  // namespace estuary::coupler
