/*
 * camera: from positions of a file to samples of a picture and back.
 *
 * A view is a direction; a camera is a view that is fitted to a mesh. Points on the picture are
 * counted in samples from its centre: x to the right, y down, and a depth away from the viewer
 * that is in samples too: exactly so without perspective, and near the target with it.
 */
#ifndef WH_GEOM_CAMERA_H
#define WH_GEOM_CAMERA_H

#include "geom/vec3.h"

#include <stdbool.h>
#include <stdint.h>

typedef enum wh_up { WH_UP_X, WH_UP_Y, WH_UP_Z } wh_up;

/* Where the viewer stands: degrees to the right of the front, and above the horizon. From the
 * front, x points to the right when y or z is up, y when x is. */
typedef struct wh_view {
	double azimuth, elevation;
} wh_view;

/* A point of the picture; depth is not a number for what cannot be seen at all: points behind the
 * viewer, or too far away for numbers. */
typedef struct wh_pixel_point {
	double x, y, depth;
} wh_pixel_point;

typedef struct wh_camera {
	wh_vec3 target;            /* file coordinates */
	double unit;               /* of file coordinates: what is 1 below */
	wh_vec3 right, up, back;   /* orthonormal; back: towards the viewer */
	double eye;                /* distance of the viewer from the target; 0: no perspective */
	double samples;            /* in one unit, at the distance of the target */
	double centre_x, centre_y; /* of the picture, in units from the target, right and up */
} wh_camera;

/* A camera at the middle of the box lo .. hi, not yet fitted: one sample a unit. False when the
 * box has no size, or one that numbers do not hold. */
bool wh_camera_open(wh_camera *k, wh_vec3 lo, wh_vec3 hi, wh_view view, wh_up up, bool perspective);

/* Fits the rectangle lo .. hi of points as the camera gives them so far, in a picture of so many
 * samples with some margin; zoom 1 just fits. */
void wh_camera_fit(wh_camera *k, const double lo[2], const double hi[2], double width,
                   double height, double zoom);

/* Where a point is on the picture. Points beyond WH_CAMERA_MOST samples are drawn in towards the
 * centre, on a line with it. */
enum { WH_CAMERA_MOST = 524288 };
wh_pixel_point wh_camera_project(const wh_camera *k, wh_vec3 p);

/* The file coordinates of a point of the picture. */
wh_vec3 wh_camera_unproject(const wh_camera *k, wh_pixel_point p);

/* The point as seen by the viewer, undistorted by perspective: in samples, x to the right, y
 * down, z away. For normals. */
static inline wh_vec3 wh_camera_straighten(const wh_camera *k, double x, double y, double depth)
{
	if (k->eye == 0)
		return wh_v3(x, y, depth);
	const double far = 1 / (1 - depth / (k->samples * k->eye)); /* in eyes */
	return wh_v3((x + k->centre_x * k->samples) * far, (y - k->centre_y * k->samples) * far,
	             (far - 1) * k->eye * k->samples);
}

#endif
