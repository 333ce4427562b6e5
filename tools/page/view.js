/*
 * The view of a page: a mesh to turn around. Followed, within one function, by what shows meshes in
 * it: levels.js of a report, or play.js of a progressive mesh; these call start().
 *
 * A frame is drawn when something has changed, and at no other time. Space is turned so that up is
 * y, and scaled so that what comes first has a radius of about 1 around the origin.
 */
const FIELD = 28 * Math.PI / 180; // of view, the lesser of both
const byId = id => document.getElementById(id);
const data = JSON.parse(byId('data').textContent);
const canvas = byId('canvas');

function fail(text)
{
	const trouble = byId('trouble');
	trouble.textContent = text;
	trouble.hidden = false;
}

/* ---- data ---------------------------------------------------------------------------------- */

function bytesOf(id)
{
	const text = atob(byId(id).textContent);
	const bytes = new Uint8Array(text.length);
	for (let i = 0; i < text.length; i++)
		bytes[i] = text.charCodeAt(i);
	return bytes;
}

/* What is flat lies: the rule of whittle render. */
function guessUp(box)
{
	const side = [0, 1, 2].map(k => box.hi[k] - box.lo[k]);
	return side[2] < 0.5 * Math.min(side[0], side[1]) ? 'z' : 'y';
}

let space = null; // what the first level fixes: middle, scale, up

function fixSpace(box)
{
	const up = data.up || guessUp(box);
	const side = box.hi.map((h, k) => h - box.lo[k]);
	space = {
		up,
		middle: box.hi.map((h, k) => (h + box.lo[k]) / 2),
		scale: 2 / (Math.hypot(side[0], side[1], side[2]) || 1),
		azimuth: data.azimuth !== undefined ? data.azimuth : 30,
		elevation: data.elevation !== undefined ? data.elevation : up === 'z' ? 38 : 16
	};
}

/* Right, up and back of what is seen from the front. */
const TURNS = {
	x: (x, y, z) => [y, x, -z],
	y: (x, y, z) => [x, y, z],
	z: (x, y, z) => [x, z, -y]
};

/* ---- scene --------------------------------------------------------------------------------- */

const three = {};

function openScene()
{
	const light = Number(THREE.REVISION) >= 155 ? Math.PI : 1; // units changed there
	three.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true, preserveDrawingBuffer: true });
	three.scene = new THREE.Scene();
	three.camera = new THREE.PerspectiveCamera(30, 1, 0.01, 100);
	const lamp = new THREE.DirectionalLight(0xffffff, 0.62 * light);
	lamp.position.set(-0.6, 0.9, 1);
	three.camera.add(lamp);
	three.scene.add(three.camera, new THREE.HemisphereLight(0xffffff, 0x84786c, 0.5 * light));
	three.surface = new THREE.MeshPhongMaterial({
		color: 0xd2c5b0, specular: 0x121110, shininess: 12, side: THREE.DoubleSide,
		polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1
	});
	three.lines = new THREE.MeshBasicMaterial({ wireframe: true, transparent: true, opacity: 0.45, color: 0x2a241e });
	three.solid = new THREE.Mesh(undefined, three.surface);
	three.wires = new THREE.Mesh(undefined, three.lines);
	three.wires.visible = false;
	three.scene.add(three.solid, three.wires);
}

/* Where the viewer is: a direction, a distance, and the point that is looked at. */
const view = { azimuth: 0, elevation: 0, distance: 1, target: [0, 0, 0] };

function axes()
{
	const a = view.azimuth, e = view.elevation;
	return {
		back: [Math.sin(a) * Math.cos(e), Math.sin(e), Math.cos(a) * Math.cos(e)],
		right: [Math.cos(a), 0, -Math.sin(a)],
		up: [-Math.sin(a) * Math.sin(e), Math.cos(e), -Math.cos(a) * Math.sin(e)]
	};
}

/* Half the picture's width and height at a distance of 1. */
function halves()
{
	const aspect = canvas.clientWidth / Math.max(canvas.clientHeight, 1), h = Math.tan(FIELD / 2);
	return aspect < 1 ? [h, h / aspect] : [h * aspect, h];
}

/* The least distance from which all of the level is seen. */
function fit()
{
	const at = three.solid.geometry.attributes.position.array;
	const { back, right, up } = axes(), [w, h] = halves();
	const dot = (a, i) => a[0] * at[i] + a[1] * at[i + 1] + a[2] * at[i + 2];
	let far = 0.1;
	for (let i = 0; i < at.length; i += 3)
		far = Math.max(far, dot(back, i) + Math.max(Math.abs(dot(right, i)) / w, Math.abs(dot(up, i)) / h));
	view.distance = 1.06 * far;
}

function home()
{
	view.azimuth = space.azimuth * Math.PI / 180;
	view.elevation = Math.max(-1.55, Math.min(1.55, space.elevation * Math.PI / 180));
	view.target = [0, 0, 0];
	fit();
	redraw();
}

let asked = false;

function redraw()
{
	if (!asked)
		requestAnimationFrame(draw);
	asked = true;
}

function draw()
{
	const { camera, renderer } = three, { back } = axes(), t = view.target, d = view.distance;
	asked = false;
	camera.aspect = canvas.clientWidth / Math.max(canvas.clientHeight, 1);
	camera.fov = 2 * Math.atan(halves()[1]) * 180 / Math.PI;
	camera.near = Math.max(d - 3, d / 500);
	camera.far = d + 3;
	camera.position.set(t[0] + back[0] * d, t[1] + back[1] * d, t[2] + back[2] * d);
	camera.lookAt(t[0], t[1], t[2]);
	camera.updateProjectionMatrix();
	renderer.render(three.scene, camera);
}

function resize()
{
	three.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
	three.renderer.setSize(canvas.clientWidth, canvas.clientHeight, false);
	redraw();
}

/* ---- what can be done ---------------------------------------------------------------------- */

function turn(right, up)
{
	view.azimuth -= right;
	view.elevation = Math.max(-1.55, Math.min(1.55, view.elevation + up));
	redraw();
}

/* By shares of the picture's height. */
function move(right, up)
{
	const a = axes(), size = 2 * halves()[1] * view.distance;
	for (let k = 0; k < 3; k++)
		view.target[k] -= (a.right[k] * right + a.up[k] * up) * size;
	redraw();
}

function zoom(factor)
{
	view.distance = Math.max(0.01, Math.min(50, view.distance / factor));
	redraw();
}

function toggle(button)
{
	const on = button.getAttribute('aria-pressed') !== 'true';
	button.setAttribute('aria-pressed', on);
	return on;
}

function toggleWires()
{
	three.wires.visible = toggle(byId('wireframe'));
	redraw();
}

function toggleFacets()
{
	three.surface.flatShading = toggle(byId('facets'));
	three.surface.needsUpdate = true;
	redraw();
}

const grouped = n => String(n).replace(/\B(?=(\d{3})+$)/g, '\u202f');

/* ---- hands --------------------------------------------------------------------------------- */

const STEP = 5 * Math.PI / 180, SHIFT = 0.05, NEARER = 1.2;
const keys = {
	w: toggleWires,
	f: toggleFacets,
	'0': home, Home: home,
	'+': () => zoom(NEARER), '=': () => zoom(NEARER), '-': () => zoom(1 / NEARER)
};
const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

function onKey(e)
{
	const arrow = arrows[e.key], act = keys[e.key] || keys[e.key.toLowerCase()];
	if (e.ctrlKey || e.altKey || e.metaKey || !(arrow || act))
		return;
	e.preventDefault();
	if (act)
		act();
	else if (e.shiftKey)
		move(arrow[0] * SHIFT, arrow[1] * SHIFT);
	else
		turn(-arrow[0] * STEP, arrow[1] * STEP);
}

const fingers = new Map();

const spread = () => {
	const [a, b] = [...fingers.values()];
	return { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2, size: Math.hypot(a.x - b.x, a.y - b.y) || 1 };
};

function onMove(e)
{
	const old = fingers.get(e.pointerId), h = canvas.clientHeight;
	if (!old)
		return;
	const before = fingers.size === 2 ? spread() : null;
	fingers.set(e.pointerId, { x: e.clientX, y: e.clientY, moves: old.moves });
	if (before) {
		const now = spread();
		move((now.x - before.x) / h, (before.y - now.y) / h);
		zoom(now.size / before.size);
	} else if (old.moves) {
		move((e.clientX - old.x) / h, (old.y - e.clientY) / h);
	} else {
		turn((e.clientX - old.x) / h * Math.PI, (e.clientY - old.y) / h * Math.PI);
	}
}

function listen()
{
	canvas.addEventListener('pointerdown', e => {
		canvas.setPointerCapture(e.pointerId);
		fingers.set(e.pointerId, { x: e.clientX, y: e.clientY, moves: e.button !== 0 || e.shiftKey });
	});
	canvas.addEventListener('pointermove', onMove);
	for (const end of ['pointerup', 'pointercancel'])
		canvas.addEventListener(end, e => fingers.delete(e.pointerId));
	canvas.addEventListener('contextmenu', e => e.preventDefault());
	canvas.addEventListener('wheel', e => {
		if (document.activeElement !== canvas && !e.ctrlKey)
			return; // the page scrolls
		e.preventDefault();
		zoom(Math.exp(-Math.max(-100, Math.min(100, e.deltaY)) / 400));
	}, { passive: false });
	canvas.addEventListener('keydown', onKey);
	canvas.addEventListener('webglcontextlost', () => fail('The browser took the view away; load the page again.'));
	byId('wireframe').addEventListener('click', toggleWires);
	byId('facets').addEventListener('click', toggleFacets);
	byId('nearer').addEventListener('click', () => zoom(NEARER));
	byId('farther').addEventListener('click', () => zoom(1 / NEARER));
	byId('reset').addEventListener('click', home);
	new ResizeObserver(resize).observe(canvas);
}

/* Shows what `first` puts on the canvas. */
function start(first)
{
	try {
		openScene();
	} catch (e) {
		fail('This browser shows no three dimensions (WebGL). The pictures tell the same.');
		return;
	}
	first();
	resize();
	home();
	listen();
}
