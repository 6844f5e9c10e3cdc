#include "shell_faces.hpp"

#include <algorithm>

namespace estuary::solid {
namespace {

struct Node {
  std::uint32_t particle;
  double arm;
};

// Nodes of the lines round one shell, clockwise: the outside is on the left.
std::vector<std::pair<std::vector<Node>, bool>> lines_round(const Body& body, const Outline& outline,
                                                            double half_thickness) {
  std::vector<Node> left, right;
  for (const std::uint32_t i : outline.particle) {
    left.push_back({i, half_thickness});
    right.insert(right.begin(), {i, -half_thickness});
  }
  if (outline.closed) return {{left, true}, {right, true}};
  const auto held = [&](std::uint32_t i) { return (body.fixed[i] & 3U) == 3; };
  const bool first = held(outline.particle.front()), last = held(outline.particle.back());
  if (first && last) return {{left, false}, {right, false}};
  // One line, from a held end if there is one.
  std::vector<Node>&begin = last ? right : left, &end = last ? left : right;
  begin.insert(begin.end(), end.begin(), end.end());
  return {{begin, !first && !last}};
}

}  // namespace

ShellFaces shell_faces(const Body& body, const ShellRow& rows) {
  ShellFaces faces;
  std::vector<Node> all;
  for (std::size_t o = 0; o < body.outlines.size(); ++o) {
    const double half = 0.5 * rows.thickness(body.outline_member[o]);
    if (!(half > 0)) continue;
    for (const auto& [nodes, closed] : lines_round(body, body.outlines[o], half)) {
      ContourLine& line = faces.lines.emplace_back();
      line.closed = closed;
      for (const Node& node : nodes) {
        const std::array<double, 2> fibre = rows.rest_fibre(node.particle);
        for (std::size_t c = 0; c < 2; ++c)
          line.position.push_back(body.position[2 * node.particle + c] + node.arm * fibre[c]);
        line.held.push_back(0);
        all.push_back(node);
      }
    }
  }
  Transfer& mid = faces.mid_line;
  for (const Node& node : all) mid.touched.push_back(node.particle);
  std::sort(mid.touched.begin(), mid.touched.end());
  mid.touched.erase(std::unique(mid.touched.begin(), mid.touched.end()), mid.touched.end());
  mid.first.push_back(0);
  for (const Node& node : all) {
    mid.position.push_back(static_cast<std::uint32_t>(
        std::lower_bound(mid.touched.begin(), mid.touched.end(), node.particle) - mid.touched.begin()));
    mid.weight.push_back(1);
    mid.first.push_back(static_cast<std::uint32_t>(mid.weight.size()));
  }
  faces.arm = mid;
  for (std::size_t k = 0; k < all.size(); ++k) faces.arm.weight[k] = all[k].arm;
  return faces;
}

}  // namespace estuary::solid
