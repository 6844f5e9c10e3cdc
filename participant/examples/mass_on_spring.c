/* After `cmake --install build --prefix DIR`:
 *     cc mass_on_spring.c -I DIR/include -L DIR/lib -lestuary -lm -Wl,-rpath,DIR/lib -o mass-on-spring
 *
 * A plate on a spring, in C: the smallest solid on the C interface. The plate is one upright segment of
 * length 1, moves along x, and takes Runge-Kutta steps of its own inside the coupler's windows. */
#include <math.h>
#include <stdio.h>

#include "estuary.h"

struct state {
  double place, velocity;
};

/* x' = v, m v' = f(t) - k x, with the force linear between the two ends of the step. */
static struct state step(struct state s, double k, double m, double dt, double f0, double f1) {
  const double half = 0.5 * (f0 + f1);
  const double a1 = (f0 - k * s.place) / m;
  const double v2 = s.velocity + 0.5 * dt * a1, a2 = (half - k * (s.place + 0.5 * dt * s.velocity)) / m;
  const double v3 = s.velocity + 0.5 * dt * a2, a3 = (half - k * (s.place + 0.5 * dt * v2)) / m;
  const double v4 = s.velocity + dt * a3, a4 = (f1 - k * (s.place + dt * v3)) / m;
  s.place += dt / 6 * (s.velocity + 2 * v2 + 2 * v3 + v4);
  s.velocity += dt / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
  return s;
}

static int write_motion(estuary_participant* p, struct state s) {
  const double displacement[4] = {s.place, 0, s.place, 0}, velocity[4] = {s.velocity, 0, s.velocity, 0};
  return estuary_write(p, "Displacement", displacement) | estuary_write(p, "Velocity", velocity);
}

int main(int argc, char** argv) {
  const double vertices[4] = {0, 0, 0, 1};
  const int edge[2] = {0, 1};
  estuary_participant* p = estuary_create(argc, argv, "mass-on-spring", "solid");
  const double spring = estuary_number(p, "spring", 1.0), mass = estuary_number(p, "mass", 1.0);
  const double steps = estuary_number(p, "steps", 10);
  struct state now = {estuary_number(p, "place", 0.0), 0.0}, kept = now;
  if (estuary_set_vertices(p, 2, vertices) || estuary_set_edges(p, 1, edge) || write_motion(p, now) ||
      estuary_initialize(p)) {
    fprintf(stderr, "mass-on-spring: %s\n", estuary_error(p));
    return 1;
  }
  double own_step = 0;
  while (estuary_is_coupling_ongoing(p)) {
    if (estuary_requires_writing_checkpoint(p)) kept = now;
    double from[4], to[4];
    if (own_step == 0) own_step = estuary_max_time_step(p) / steps;
    const double dt = fmin(own_step, estuary_max_time_step(p));
    if (estuary_read(p, "Force", 0.0, from) || estuary_read(p, "Force", dt, to)) break;
    now = step(now, spring, mass, dt, from[0] + from[2], to[0] + to[2]);
    if (write_motion(p, now) || estuary_advance(p, dt)) break;
    if (estuary_requires_reading_checkpoint(p)) now = kept;
  }
  if (*estuary_error(p)) fprintf(stderr, "mass-on-spring: %s\n", estuary_error(p));
  return estuary_finalize(p) == 0 ? 0 : 1;
}
