// Where particles of one body meet another (pinballs: Belytschko & Neal 1991; of SPH bodies: Maurel 2008, ch.
// 3).
//
// Every pair of bodies has one whose particles carry balls, the more deformable, and one that brings the
// surface and its normals. Normals are those of the surface's contour (at a corner the line of centres), or
// with `centre_line` always the line between the centres of two balls, which is the thesis's default and
// rough to slide on. Fluids never meet each other here: they are neighbours. Candidates (a particle, a piece
// of a surface) are kept in a list with a margin, so that a step tests only those; a candidate makes a row
// when the surfaces may touch within the step. Friction acts on the faces of shells, half a thickness from
// their particles, and so turns their fibres; what is left of the way between particle and contour, a gap,
// turns a rigid body if there is one, else the shells, else, between solids, the piece of contour: it is met
// where the particle is, as if it reached so far out, and a couple across its two ends carries the moment.
// Angular momentum is kept, but between two balls that a tear has exposed, which are single particles.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "impulses.hpp"
#include "particles.hpp"

namespace estuary::solid {

enum class ContactNormals { contour, centre_line };

/// Of one body.
struct ContactMember {
  double hardness = 0;        // of two bodies that meet the harder one brings the surface
  double half_thickness = 0;  // its surface lies so far from its contour, on both sides of a shell [m]
  bool two_sided = false;     // a shell
  bool fluid = false;         // brings balls only, one at every particle
  double radius = 0;          // of its balls [m]
};

struct PinballSettings {
  std::vector<ContactMember> members;
  ContactNormals normals = ContactNormals::contour;
  double penetration_correction = 0;  // share of a penetration taken back in a step
  bool friction = false;              // along faces, which turns what they belong to
};

class Pinball {
public:
  Pinball(const Body& body, PinballSettings settings);

  /// Rows of a state that will move for `time_step`. `scale` of each particle's ball, 1 when undisturbed.
  /// `rigid` are the state's values of rigid bodies.
  const std::vector<ContactRow>& find(std::span<const double> position, std::span<const double> rigid,
                                      double time_step);
  [[nodiscard]] std::vector<ContactRow>& rows() { return rows_; }
  /// Surfaces without these pieces, each given by its two particles in the order of its contour: there a body
  /// is torn, and what comes passes through. Particles that a tear has exposed, inside contours until then,
  /// meet others as balls of half a spacing, which reaches to the middle of a crack.
  void tear(std::span<const std::array<std::uint32_t, 2>> pieces,
            std::span<const std::uint32_t> exposed = {});
  /// Particles that meet nothing any more (1 for each of the body; empty: none).
  void leave_out(std::vector<std::uint8_t> particles) { left_out_ = std::move(particles); }
  /// Pairs now in the list of candidates.
  [[nodiscard]] std::size_t candidates() const { return candidate_.size(); }

private:
  static constexpr std::uint32_t kNone = 0xffffffffU;
  struct Segment {
    std::uint32_t a, b;           // particles; the outside is on the left. One alone: a ball
    std::uint32_t before, after;  // of the same contour; kNone at an end
    std::uint8_t member;
  };
  struct Candidate {
    std::uint32_t point, segment;
  };

  [[nodiscard]] double radius_of(std::uint32_t point) const {
    return exposed_[point] != 0 ? 0.5 * spacing_ : settings_.members[body_.member[point]].radius;
  }
  [[nodiscard]] bool stale(std::span<const double> position) const;
  void find_candidates(std::span<const double> position);
  void meet(std::uint32_t point, std::size_t begin, std::size_t end, std::span<const double> x);
  void meet_balls(std::uint32_t point, std::size_t begin, std::size_t end, std::span<const double> x);
  /// `reach`: from the contour to the point; `gap`: what of it is neither shell nor ball.
  void add_row(std::uint32_t point, const Segment& segment, double share, double nx, double ny, double reach,
               double gap, std::span<const double> x);
  /// Friction acts `arm` along the normal from the particle.
  void attach(ContactRow& row, std::uint32_t particle, double weight, double nx, double ny, double arm,
              std::span<const double> x) const;
  /// Friction on the surface acts `arm` off the piece, towards the point.
  void reach_out(ContactRow& row, const Segment& segment, double arm, std::span<const double> x);
  /// Of friction on the point and on the surface, from where each is, towards the other.
  [[nodiscard]] std::array<double, 2> arms(std::uint32_t point, const Segment& segment, double reach) const;

  const Body& body_;
  PinballSettings settings_;
  double spacing_;
  std::vector<Segment> segments_;
  std::vector<std::uint8_t> torn_;     // of every segment
  std::size_t whole_ = 0;              // segments of contours; balls follow
  std::vector<std::uint32_t> points_;  // particles that carry balls
  std::size_t whole_points_ = 0;       // of them, from the start
  std::vector<std::uint8_t> exposed_;  // of every particle
  std::vector<std::uint8_t> left_out_;
  std::vector<std::uint32_t> rigid_of_;  // of every particle; kNone when it is free
  std::vector<std::uint32_t> turns_;  // with friction: of every particle the number of its fibre; kNone: none
  std::vector<Candidate> candidate_;  // in the order of points_
  std::vector<double> built_at_;
  std::vector<ContactRow> rows_;
  std::span<const double> rigid_;
  double time_step_ = 0;
  std::vector<std::uint32_t> cell_first_, cell_segment_;
};

}  // namespace estuary::solid
