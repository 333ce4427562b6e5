/*
 * With perspective, the depth of a point at distance w from the viewer, who is e away from the
 * target, is s e (1 - e / w) for s samples a unit: linear on the picture, as that of a plane has
 * to be, and of slope s at the target.
 */
#include "geom/camera.h"

static const double EYE = 4; /* in units of half the diagonal: a field of view of 28 degrees */
static const double NEAREST = 0.05; /* nothing nearer to the viewer is seen, same unit */
static const double MARGIN = 0.04;  /* of the picture, on each side */
static const double RADIAN = 3.14159265358979323846 / 180;

/* Cosine and sine, exact where it matters for straight views. */
static void turn(double degrees, double *cosine, double *sine)
{
	const double quarter = degrees / 90;
	*cosine = cos(degrees * RADIAN);
	*sine = sin(degrees * RADIAN);
	if (quarter == floor(quarter)) {
		*cosine = round(*cosine);
		*sine = round(*sine);
	}
}

static void aim(wh_camera *k, wh_view view, wh_up up)
{
	static const wh_vec3 axes[][3] = {/* right, up, towards the viewer in front */
	                                  [WH_UP_X] = {{0, 1, 0}, {1, 0, 0}, {0, 0, -1}},
	                                  [WH_UP_Y] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
	                                  [WH_UP_Z] = {{1, 0, 0}, {0, 0, 1}, {0, -1, 0}}};
	const wh_vec3 *a = axes[up];
	double ca, sa, ce, se;
	turn(view.azimuth, &ca, &sa);
	turn(view.elevation, &ce, &se);
	k->right = wh_sub(wh_scale(a[0], ca), wh_scale(a[2], sa));
	const wh_vec3 out = wh_add(wh_scale(a[0], sa), wh_scale(a[2], ca));
	k->back = wh_add(wh_scale(out, ce), wh_scale(a[1], se));
	k->up = wh_sub(wh_scale(a[1], ce), wh_scale(out, se));
}

bool wh_camera_open(wh_camera *k, wh_vec3 lo, wh_vec3 hi, wh_view view, wh_up up, bool perspective)
{
	const wh_vec3 half = wh_sub(wh_scale(hi, 0.5), wh_scale(lo, 0.5));
	const double most = fmax(half.x, fmax(half.y, half.z));
	*k = (wh_camera){.target = wh_add(wh_scale(lo, 0.5), wh_scale(hi, 0.5)),
	                 .eye = perspective ? EYE : 0,
	                 .samples = 1};
	if (!(most > 1e-300) || !(most < 1e300))
		return false;
	k->unit = most * wh_norm(wh_scale(half, 1 / most));
	aim(k, view, up);
	return true;
}

void wh_camera_fit(wh_camera *k, const double lo[2], const double hi[2], double width,
                   double height, double zoom)
{
	const double room = 1 - 2 * MARGIN;
	const double x = fmax(hi[0] - lo[0], 1e-6), y = fmax(hi[1] - lo[1], 1e-6);
	k->samples = fmin(width * room / x, height * room / y) * zoom;
	k->centre_x = (lo[0] + hi[0]) / 2;
	k->centre_y = -(lo[1] + hi[1]) / 2;
}

wh_pixel_point wh_camera_project(const wh_camera *k, wh_vec3 p)
{
	const wh_vec3 d = wh_scale(wh_sub(p, k->target), 1 / k->unit);
	const double x = wh_dot(k->right, d), y = wh_dot(k->up, d), z = wh_dot(k->back, d);
	wh_pixel_point q = {(x - k->centre_x) * k->samples, (k->centre_y - y) * k->samples,
	                    -z * k->samples};
	if (k->eye > 0) {
		const double w = k->eye - z, shrink = k->eye / w;
		q.x = (x * shrink - k->centre_x) * k->samples;
		q.y = (k->centre_y - y * shrink) * k->samples;
		q.depth = w > NEAREST ? k->samples * k->eye * (1 - shrink) : NAN;
	}
	const double most = fmax(fabs(q.x), fmax(fabs(q.y), fabs(q.depth)));
	if (!isfinite(most) || !isfinite(q.x + q.y))
		q.depth = NAN;
	else if (most > WH_CAMERA_MOST) {
		const double in = WH_CAMERA_MOST / most;
		q = (wh_pixel_point){q.x * in, q.y * in, q.depth * in};
	}
	return q;
}

wh_vec3 wh_camera_unproject(const wh_camera *k, wh_pixel_point p)
{
	const wh_vec3 s = wh_camera_straighten(k, p.x, p.y, p.depth);
	const double unit = k->unit / k->samples;
	/* straightened points are from the target's axis, plain ones from the picture's centre */
	const double x = k->eye > 0 ? s.x : s.x + k->centre_x * k->samples;
	const double y = k->eye > 0 ? -s.y : k->centre_y * k->samples - s.y;
	const wh_vec3 d =
	    wh_add(wh_add(wh_scale(k->right, x), wh_scale(k->up, y)), wh_scale(k->back, -s.z));
	return wh_add(k->target, wh_scale(d, unit));
}
