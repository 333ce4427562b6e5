/*
 * smooth: fairing of a surface that does not shrink it.
 *
 * G. Taubin, "A signal processing approach to fair surface design", SIGGRAPH 1995: each vertex goes
 * some way to the mean of its neighbours, and then a little farther back. What is rough is damped,
 * what is wide stays: together the two steps are a low-pass filter.
 */
#ifndef WH_MESH_SMOOTH_H
#define WH_MESH_SMOOTH_H

#include "mesh/mesh.h"

/*
 * So many pairs of steps. Vertices on edges of one face, or of more than two, stay where they are.
 * Positions depend on the mesh alone. Bytes that it takes: wh_smooth_bytes.
 */
wh_code wh_smooth(wh_ctx *c, const wh_mesh *m, uint32_t times);
size_t wh_smooth_bytes(uint64_t nv, uint64_t nf);

/* For each vertex the mean of the normals of its faces by their areas, one long; 0 where there is
 * none. */
void wh_mesh_normals(const wh_mesh *m, wh_vec3 *normal);

#endif
