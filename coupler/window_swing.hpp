// Forces that swing from window to window while every window's iteration converges: an instability of the
// windows, not of the iteration, and what a failed window is often only the end of.
#pragma once

#include <span>
#include <vector>

namespace estuary::coupler {

class WindowSwing {
public:
  /// The nodal forces of a window that was accepted.
  void accept(std::span<const double> forces);

  /// How much the forces changed from window to window over the last ten or so, as a share of themselves
  /// (root mean squares over the wet nodes), when that points back against the change before rather than on;
  /// else 0. A share below a half is not counted: that is what nodes that are covered one by one make.
  [[nodiscard]] double share() const;

private:
  std::vector<double> last_, last_change_;
  // Sums that forget a tenth with each window.
  double forces_ = 0;   // of |F|^2
  double changes_ = 0;  // of |dF|^2
  double returns_ = 0;  // of dF . dF of the window before
  int windows_ = 0;     // so far, up to ten
};

}  // namespace estuary::coupler
