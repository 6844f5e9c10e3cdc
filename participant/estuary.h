/* Participants in C, and in every language that calls C: the calls an adapter knows from preCICE, in the same
 * order.
 *
 *     estuary_participant* p = estuary_create(argc, argv, "my-solver", "solid");
 *     estuary_set_vertices(p, n, positions);
 *     estuary_set_edges(p, n - 1, ends);
 *     if (estuary_initialize(p) != 0) ...
 *     while (estuary_is_coupling_ongoing(p)) {
 *       if (estuary_requires_writing_checkpoint(p)) ...keep the state...
 *       double dt = fmin(my_dt, estuary_max_time_step(p));
 *       estuary_read(p, "Force", dt, force);
 *       ...one step...
 *       estuary_write(p, "Displacement", displacement);
 *       estuary_advance(p, dt);
 *       if (estuary_requires_reading_checkpoint(p)) ...take the kept state back...
 *     }
 *     estuary_finalize(p);
 *
 * The program is launched by the coupler like any other participant (`solver = "my-solver"` in its table of
 * the scene); a thread of the library answers the coupler meanwhile. Points are x0 y0 x1 y1 ..., SI units, in
 * two dimensions forces are per metre of depth. Walked from the first to the second end of an edge, the fluid
 * lies to the left.
 *
 * Fields, values per vertex:
 *     role "solid"   reads "Force" (2) [N/m]; writes "Displacement" (2) [m], "Velocity" (2) [m/s]
 *     role "fluid"   reads "Displacement", "Velocity"; writes "Pressure" (1) [Pa], "ViscousTraction" (2) [Pa]
 * A fluid brings vertices of its own, and the coupler maps to and from them. A solid that never writes
 * "Velocity" is taken to have moved evenly through the window.
 *
 * Calls that return int give 0, or a negative number with estuary_error() to say why. Calls from one thread
 * only. Limits: two dimensions; no Save and Load, so a stopped run cannot be resumed with it; one participant
 * a process. */
#ifndef ESTUARY_H
#define ESTUARY_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct estuary_participant estuary_participant;

/* Serves at the address that the command line names and waits for the scene. `role` is the scene's table it
 * plays: "fluid" or "solid". Ends the process when the command line asks for something else than a run
 * (--help, --version), or is wrong. */
estuary_participant* estuary_create(int argc, char** argv, const char* name, const char* role);

/* A number of the participant's own table of the scene, `fallback` where it is absent. Before
 * estuary_initialize. Keys that nobody asked for are refused there. */
double estuary_number(estuary_participant* participant, const char* key, double fallback);

/* The wet surface: vertices [m], and edges between them (two vertex numbers each). Before estuary_initialize.
 */
int estuary_set_vertices(estuary_participant* participant, size_t count, const double* positions);
int estuary_set_edges(estuary_participant* participant, size_t count, const int* ends);

/* Waits until the first window is to be computed. What was written before is the state at the start. Ends the
 * process with --check, which asks only whether the scene is right. */
int estuary_initialize(estuary_participant* participant);

int estuary_is_coupling_ongoing(const estuary_participant* participant);
/* What is left of the window [s]; 0 in steady mode, where a window is one equilibrium and `dt` has no
 * meaning. */
double estuary_max_time_step(const estuary_participant* participant);

/* 1 at the start of every window that may be repeated, until asked; 1 after an advance when the window is
 * repeated. */
int estuary_requires_writing_checkpoint(estuary_participant* participant);
int estuary_requires_reading_checkpoint(estuary_participant* participant);

/* The field at `relative_time` [s] from now, between 0 and the largest time step: linear in the window. */
int estuary_read(estuary_participant* participant, const char* field, double relative_time, double* values);
/* The field at the end of the step that estuary_advance ends. */
int estuary_write(estuary_participant* participant, const char* field, const double* values);

/* A step of `dt` [s] is done. With the step that ends the window, waits for the next one (or for this one
 * again). */
int estuary_advance(estuary_participant* participant, double dt);

/* The solver cannot go on: the coupler is told why and what to try, and decides. Instead of estuary_advance.
 */
int estuary_diverged(estuary_participant* participant, const char* what, const char* advice);

int estuary_finalize(estuary_participant* participant);

/* Why the last call failed; empty when it did not. */
const char* estuary_error(const estuary_participant* participant);

#ifdef __cplusplus
}
#endif

#endif
