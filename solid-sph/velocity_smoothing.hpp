// Conservative smoothing of velocities, the oldest remedy against the sawtooth of SPH: for comparison.
//
// After Swegle (1994) and Randles & Libersky (1996), v_i moves by alpha towards the mean of its neighbours;
// the pair weights are made symmetric here, so that momentum is kept to round-off. What it takes from the
// motion is counted.
#pragma once

#include <vector>

#include "neighbourhood.hpp"

namespace estuary::solid {

class VelocitySmoothing {
public:
  /// `strength` is alpha, between 0 and 0.5.
  VelocitySmoothing(const Body& body, const Neighbourhood& pairs, Kernel kernel, double strength);
  /// Smooths once; returns the kinetic energy taken [J/m].
  double apply(std::vector<double>& velocity);

private:
  const Body& body_;
  const Neighbourhood& pairs_;
  std::vector<double> weight_;  // alpha s_ij, one per pair [kg/m]
  std::vector<double> smoothed_;
};

}  // namespace estuary::solid
