#include "stability_plots.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "study_plots.hpp"
#include "study_table.hpp"

namespace estuary::coupler {
namespace {

constexpr std::array<StabilityClass, 7> classes{
    StabilityClass::stable, StabilityClass::inaccurate, StabilityClass::stalled, StabilityClass::diverged,
    StabilityClass::lost,   StabilityClass::refused,    StabilityClass::not_run};

const char* lie_colour = "#ff00ff";

std::string ticks(char axis, const StudyAxis& shown) {
  std::string text = fmt::format("set {}tics (", axis);
  for (std::size_t k = 0; k < shown.labels.size(); ++k)
    text += fmt::format("{}{} {}", k == 0 ? "" : ", ", Gnuplot::quoted(shown.labels[k]), k);
  const auto is_long = [](const std::string& label) { return label.size() > 14; };
  const bool crowded =
      shown.labels.size() > 8 || std::any_of(shown.labels.begin(), shown.labels.end(), is_long);
  return text + fmt::format("){}\n", axis == 'x' && crowded ? " rotate by -25" : "");
}

std::string frame(const StudyScene& study) {
  std::string script = "set border 3 lc rgb '#606060'\nset tics nomirror out scale 0.3\n";
  if (study.axes.empty()) {
    script += "set xrange [-0.5:0.5]\nunset xtics\n";
  } else {
    script += ticks('x', study.axes[0]) + fmt::format("set xrange [-0.5:{}]\nset xlabel {}\n",
                                                      static_cast<double>(study.axes[0].labels.size()) - 0.5,
                                                      Gnuplot::quoted(study.axes[0].name));
  }
  if (study.axes.size() > 1) {
    script += ticks('y', study.axes[1]) + fmt::format("set yrange [-0.5:{}]\nset ylabel {}\n",
                                                      static_cast<double>(study.axes[1].labels.size()) - 0.5,
                                                      Gnuplot::quoted(study.axes[1].name));
  }
  return script;
}

std::size_t step_of(const StudyCell& cell, std::size_t axis) {
  return axis < cell.steps.size() ? cell.steps[axis] : 0;
}

/// A block of data for each class that occurs, drawn `with`, named in the key.
template <typename Row>
std::string by_class(const StabilityMap& map, const std::string& with, std::string& pieces, const Row& row) {
  std::string script;
  const auto add = [&](const std::string& name, const std::string& colour, const auto& belongs) {
    std::string rows;
    for (const auto& run : map.runs) {
      if (belongs(run.verdict)) rows += row(run);
    }
    if (rows.empty()) return;
    const auto block = fmt::format("$class_{}", name == "not run" ? "open" : name);
    script += fmt::format("{} << END\n{}END\n", block, rows);
    pieces += fmt::format("{}{} {} title '{}'", pieces.empty() ? "plot " : ", ", block,
                          fmt::format(fmt::runtime(with), colour), name);
  };
  for (const auto kind : classes) {
    add(class_name(kind), class_colour(kind, false),
        [&](const StabilityVerdict& verdict) { return verdict.kind == kind && !verdict.lie; });
  }
  add("lie", lie_colour, [](const StabilityVerdict& verdict) { return verdict.lie; });
  return script;
}

std::string field_of_classes(const StudyScene& study, const StabilityMap& map) {
  std::string script = frame(study);
  if (study.axes.size() < 2) script += "set yrange [-0.5:0.5]\nunset ytics\n";
  std::string pieces;
  script +=
      by_class(map, "using 1:2:(0.48):(0.48) with boxxyerror lc rgb '{}' fs solid 0.85 noborder", pieces,
               [](const StabilityRun& run) {
                 return fmt::format("{} {}\n", step_of(run.result.cell, 0), step_of(run.result.cell, 1));
               });
  // In each field what it cost (iterations per window) or how far off it is.
  script += "$text << END\n";
  for (const auto& run : map.runs) {
    std::string text = " ";
    if (run.verdict.kind == StabilityClass::stable || run.verdict.kind == StabilityClass::inaccurate)
      text = std::isfinite(run.result.error) ? percent_text(run.result.error) : " ";
    script += fmt::format("{} {} \"{}\"\n", step_of(run.result.cell, 0), step_of(run.result.cell, 1), text);
  }
  script += "END\n";
  return script + pieces + ", $text using 1:2:3 with labels font ',9' notitle\n";
}

std::string runs_and_limit(const StudyScene& study, const StabilityMap& map) {
  const StudyBisection& bisection = *study.bisection;
  std::string script = frame(study) + fmt::format("set ylabel {}\n", Gnuplot::quoted(bisection.key));
  if (bisection.logarithmic) script += "set logscale y\nset format y '%g'\n";
  double low = std::min(bisection.from, bisection.to);
  double high = std::max(bisection.from, bisection.to);
  const double margin = bisection.logarithmic ? std::pow(high / low, 0.05) : 0.05 * (high - low);
  script += bisection.logarithmic ? fmt::format("set yrange [{:.6g}:{:.6g}]\n", low / margin, high * margin)
                                  : fmt::format("set yrange [{:.6g}:{:.6g}]\n", low - margin, high + margin);
  std::string pieces;
  script += by_class(map, "using 1:2 with points lc rgb '{}' pt 7 ps 1", pieces, [](const StabilityRun& run) {
    return fmt::format("{} {:.9g}\n", step_of(run.result.cell, 0), run.result.cell.bisected.value_or(0));
  });
  std::string limits;
  for (const auto& limit : map.limits) {
    if (limit.holds && limit.fails)
      limits += fmt::format("{} {:.9g}\n", step_of(limit.cell, 0),
                            middle_of(bisection, *limit.holds, *limit.fails));
  }
  if (limits.empty()) return script + pieces + "\n";
  script += fmt::format("$limits << END\n{}END\n", limits);
  return script + pieces +
         ", $limits using 1:2 with linespoints lc rgb '#202020' lw 1.5 dt 2 pt 1 title 'limit'\n";
}

std::string field_of_limits(const StudyScene& study, const StabilityMap& map) {
  const StudyBisection& bisection = *study.bisection;
  std::string script = frame(study) + "set palette defined (0 '#b2182b', 1 '#f7f7f7', 2 '#2166ac')\n" +
                       fmt::format("set cblabel {}\n", Gnuplot::quoted("limit of " + bisection.key));
  if (bisection.logarithmic) script += "set logscale cb\nset format cb '%g'\n";
  script += fmt::format("set cbrange [{:.6g}:{:.6g}]\nset tmargin 2\n$limits << END\n",
                        std::min(bisection.from, bisection.to), std::max(bisection.from, bisection.to));
  for (const auto& limit : map.limits) {
    if (!limit.holds && !limit.fails) continue;
    const double value = !limit.fails   ? bisection.to
                         : !limit.holds ? bisection.from
                                        : middle_of(bisection, *limit.holds, *limit.fails);
    const auto text = !limit.fails ? "holds" : !limit.holds ? "fails" : fmt::format("{:.3g}", value);
    script +=
        fmt::format("{} {} {:.9g} \"{}\"\n", step_of(limit.cell, 0), step_of(limit.cell, 1), value, text);
  }
  return script +
         "END\nunset key\nplot $limits using 1:2:(0.48):(0.48):3 with boxxyerror palette fs solid noborder, "
         "$limits using 1:2:4 with labels font ',10'\n";
}

}  // namespace

const char* class_colour(StabilityClass kind, bool lie) {
  if (lie) return lie_colour;
  switch (kind) {
    case StabilityClass::stable:
      return "#2e9e5b";
    case StabilityClass::inaccurate:
      return "#f2cf4a";
    case StabilityClass::stalled:
      return "#e98b2a";
    case StabilityClass::diverged:
      return "#c8372d";
    case StabilityClass::lost:
      return "#202020";
    case StabilityClass::refused:
      return "#9aa3ad";
    case StabilityClass::not_run:
      break;
  }
  return "#e6e8ea";
}

void draw_stability(const StudyScene& study, const StabilityMap& map, const std::filesystem::path& stem,
                    const Gnuplot& gnuplot) {
  if (map.runs.empty()) throw std::runtime_error("nothing was run");
  std::string script = "set key outside below samplen 1.5\n";
  if (!study.bisection) {
    script += field_of_classes(study, map);
  } else if (study.axes.size() > 1) {
    script += field_of_limits(study, map);
  } else {
    script += runs_and_limit(study, map);
  }
  const auto columns = study.axes.empty() ? 1 : study.axes[0].labels.size();
  const auto rows = study.axes.size() > 1 ? study.axes[1].labels.size() : std::size_t{1};
  const auto width = static_cast<unsigned>(std::clamp<std::size_t>(220 + 84 * columns, 520, 1200));
  const auto height = static_cast<unsigned>(
      study.bisection && study.axes.size() < 2 ? 460 : std::clamp<std::size_t>(170 + 46 * rows, 260, 1100));
  draw_svg_and_png(script, width, height, stem, gnuplot);
}

}  // namespace estuary::coupler
