// A scene's text, and after a line of four bars its overrides, one a line: parsed, then read by the coupler's
// reader or, every other one, by something that asks for everything; what has overrides is written as it was
// run and read again, which must find the same.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <numeric>
#include <string>
#include <vector>

#include "coupling_scene.hpp"
#include "scene.hpp"

namespace {

// Whatever a solver may ask of a key: one question for each, which follows from the input, so that a scene
// that is asked costs no more than one that is read. Answers of other kinds are in other inputs.
void ask(estuary::SceneTable table, unsigned question, int depth) {
  if (depth > 6) return;
  for (const auto& key : table.keys()) {
    (void)table.has(key);
    switch (question++ % 9) {
      case 0:
        (void)table.number_or(key, 1.0, estuary::Range::positive());
        break;
      case 1:
        (void)table.integer_or(key, 1, -5, 5);
        break;
      case 2:
        (void)table.boolean_or(key, true);
        break;
      case 3:
        (void)table.text_or(key, "");
        break;
      case 4:
        (void)table.texts_or_empty(key);
        break;
      case 5:
        (void)table.numbers(key, 2);
        break;
      case 6:
        (void)table.points(key, 3);
        break;
      case 7:
        (void)table.expressions(key, 0);
        break;
      default:
        (void)table.file(key);
    }
    for (auto& below : table.tables(key)) ask(below, question, depth + 1);
    if (auto below = table.table_if(key)) ask(*below, question, depth + 1);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string bytes(reinterpret_cast<const char*>(data), size);
  const auto bars = bytes.find("\n||||\n");
  const std::string text = bytes.substr(0, bars);
  std::vector<std::string> overrides;
  if (bars != std::string::npos) {
    for (std::size_t at = bars + 6; at < bytes.size() && overrides.size() < 20;) {
      const auto end = std::min(bytes.find('\n', at), bytes.size());
      overrides.push_back(bytes.substr(at, end - at));
      at = end + 1;
    }
  }
  auto scene = estuary::Scene::parse(text, "fuzz", overrides);
  const bool sound = scene.problems().empty();
  const std::vector<std::string_view> without{"title", "coupling.window"};
  if (sound && !overrides.empty()) {  // without any it is the text itself
    const auto again = estuary::Scene::parse(scene.as_run(), "again");
    if (!again.problems().empty() || again.canonical({}) != scene.canonical({})) std::abort();
  }
  if (sound && !overrides.empty()) (void)scene.canonical(without);
  scene.confine_files("/tmp");
  const unsigned sum = std::accumulate(data, data + size, 0U);
  if (!sound) {
    // Nobody reads a scene that is none.
  } else if (sum % 2 == 0) {
    (void)estuary::coupler::read_coupling_scene(scene);
  } else {
    ask(scene.root(), sum / 2, 0);
  }
  for (const auto& problem : scene.problems()) (void)estuary::describe("fuzz", problem);
  return 0;
}
