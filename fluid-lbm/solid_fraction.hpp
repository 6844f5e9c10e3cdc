// Which part of a cell, a unit square or cube around a node, a disc or sphere covers.
#pragma once

namespace estuary::fluid {

/// Area of the unit square around (x, y) inside the disc of `radius` around the origin. Exact.
[[nodiscard]] double disc_fraction(double x, double y, double radius);

/// Volume of the unit cube around (x, y, z) inside the sphere of `radius` around the origin. The sphere is
/// replaced by the plane that cuts off the same volume on average: its tangential plane, moved inwards for
/// the curvature; the volume of a cube below a plane is that of Scardovelli, Zaleski, J. Comput. Phys. 164
/// (2000). Errs by less than 0.02 for radii above 2, and by less than 1e-3 in the sum over all cells.
[[nodiscard]] double sphere_fraction(double x, double y, double z, double radius);

}  // namespace estuary::fluid
