/*
 * A progressive mesh: its splits forward and back, and what lies between two of its levels.
 *
 * The arrays are those of the finest level of the page; a split that is undone turns its corners
 * back to the vertex that it split, and exchanges that one's place with the one it had before: see
 * src/algo/progressive_play.c, which does the same.
 */
const read = (id, Type) => new Type(bytesOf(id).buffer);
const mesh = {
	place: read('place', Float32Array), corner: read('corner', Uint32Array),
	vertex: read('vertex', Uint32Array), other: read('other', Float32Array),
	made: read('made', Uint8Array), count: read('turned', Uint8Array), turns: read('turns', Uint32Array)
};
if (byId('colour')) {
	mesh.colour = lightOf(read('colour', Uint8Array));
	mesh.otherColour = lightOf(read('other-colour', Uint8Array));
}
const LAST = mesh.vertex.length, BASE = data.base_vertices;
const first = new Uint32Array(LAST + 1), faces = new Uint32Array(LAST + 1); // of split, at level
faces[0] = data.base_faces;
for (let j = 0; j < LAST; j++) {
	first[j + 1] = first[j] + mesh.count[j];
	faces[j + 1] = faces[j] + mesh.made[j];
}

/* Colours as shares of light where three.js wants them so, else as they are. */
function lightOf(bytes)
{
	const linear = Number(THREE.REVISION) >= 152;
	const share = Float32Array.from({ length: 256 }, (_, i) => {
		const c = i / 255;
		return !linear ? c : c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
	});
	return Float32Array.from(bytes, byte => share[byte]);
}

/* ---- levels -------------------------------------------------------------------------------- */

let level = LAST;

function turnCorners(j, to)
{
	for (let i = first[j]; i < first[j + 1]; i++)
		mesh.corner[mesh.turns[i]] = to;
}

function exchangeIn(own, other, j)
{
	const v = 3 * mesh.vertex[j];
	for (let k = 0; k < 3; k++) {
		const was = own[v + k];
		own[v + k] = other[3 * j + k];
		other[3 * j + k] = was;
	}
}

function exchange(j)
{
	exchangeIn(mesh.place, mesh.other, j);
	if (mesh.colour)
		exchangeIn(mesh.colour, mesh.otherColour, j);
}

function goTo(to)
{
	for (; level < to; level++) {
		turnCorners(level, BASE + level);
		exchange(level);
	}
	while (level > to) {
		level--;
		turnCorners(level, mesh.vertex[level]);
		exchange(level);
	}
}

/* The finest level with no more faces. */
function levelOf(n)
{
	let lo = 0, hi = LAST;
	while (lo < hi) {
		const mid = Math.ceil((lo + hi) / 2);
		if (faces[mid] <= n)
			lo = mid;
		else
			hi = mid - 1;
	}
	return lo;
}

/* Sums of the faces' normals, each as long as twice the face's area, made one long. */
function normalsAt(place, nf, out)
{
	const c = mesh.corner;
	out.fill(0);
	for (let f = 0; f < 3 * nf; f += 3) {
		const [p, q, r] = [3 * c[f], 3 * c[f + 1], 3 * c[f + 2]];
		const ax = place[q] - place[p], ay = place[q + 1] - place[p + 1], az = place[q + 2] - place[p + 2];
		const bx = place[r] - place[p], by = place[r + 1] - place[p + 1], bz = place[r + 2] - place[p + 2];
		const n = [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx];
		for (const v of [p, q, r])
			for (let k = 0; k < 3; k++)
				out[v + k] += n[k];
	}
	for (let i = 0; i < out.length; i += 3) {
		const size = Math.hypot(out[i], out[i + 1], out[i + 2]) || 1;
		for (let k = 0; k < 3; k++)
			out[i + k] /= size;
	}
}

/* ---- between two levels -------------------------------------------------------------------- */

let geomorph = false;
let ends = null; // of the morph at hand: levels, and places and normals of the finer one's vertices

/* Stops of the morph: each has about twice the faces of the one before it. */
const stops = Math.max(1, Math.round(Math.log2(faces[LAST] / Math.max(faces[0], 1))));
const facesAtShare = x => Math.max(faces[0], 1) * (faces[LAST] / Math.max(faces[0], 1)) ** x;
const stopAt = i => i >= stops ? LAST : i <= 0 ? 0 : levelOf(facesAtShare(i / stops));

/* For each vertex of the level at hand the one of a coarser level that it was split from, or is. */
function ancestorsAt(coarse)
{
	const from = new Uint32Array(BASE + level);
	for (let v = 0; v < from.length; v++)
		from[v] = v < BASE + coarse ? v : from[mesh.vertex[v - BASE]];
	return from;
}

function spreadOver(values, from)
{
	const out = new Float32Array(3 * from.length);
	from.forEach((v, i) => out.set(values.subarray(3 * v, 3 * v + 3), 3 * i));
	return out;
}

function makeEnds(coarse, fine)
{
	const normal = new Float32Array(mesh.place.length);
	goTo(coarse);
	normalsAt(mesh.place, faces[level], normal);
	const place = mesh.place.slice(), coarseNormal = normal.slice();
	const colour = mesh.colour && mesh.colour.slice();
	goTo(fine);
	normalsAt(mesh.place, faces[level], normal);
	const from = ancestorsAt(coarse), n = 3 * from.length;
	ends = {
		coarse, fine, place: [spreadOver(place, from), mesh.place.slice(0, n)],
		normal: [spreadOver(coarseNormal, from), normal.slice(0, n)],
		colour: colour && [spreadOver(colour, from), mesh.colour.slice(0, n)]
	};
}

/* Between directions of length 1, along a great circle. */
function slerp(a, b, i, t, out)
{
	const dot = a[i] * b[i] + a[i + 1] * b[i + 1] + a[i + 2] * b[i + 2];
	const angle = Math.acos(Math.max(-1, Math.min(1, dot))), sine = Math.sin(angle);
	const p = sine < 1e-4 ? 1 - t : Math.sin((1 - t) * angle) / sine;
	const q = sine < 1e-4 ? t : Math.sin(t * angle) / sine;
	for (let k = 0; k < 3; k++)
		out[i + k] = p * a[i + k] + q * b[i + k];
}

/* ---- what is shown ------------------------------------------------------------------------- */

let share = 1; // 0: the base, 1: the finest level; by the logarithm of faces
let geometry = null;

function between([a, b], t, out)
{
	for (let i = 0; i < a.length; i++)
		out[i] = t >= 1 ? b[i] : a[i] + t * (b[i] - a[i]);
}

function blend(t)
{
	const normal = geometry.attributes.normal.array, [m, n] = ends.normal;
	between(ends.place, t, geometry.attributes.position.array);
	if (ends.colour)
		between(ends.colour, t, geometry.attributes.color.array);
	for (let i = 0; i < m.length; i += 3)
		slerp(m, n, i, t, normal);
}

function refresh(text)
{
	for (const part of [...Object.values(geometry.attributes), geometry.index])
		part.needsUpdate = true;
	geometry.setDrawRange(0, 3 * faces[level]);
	byId('count').textContent = text;
	byId('level').value = Math.round(1000 * share);
	redraw();
}

function showMorph()
{
	const at = share * stops, i = Math.min(stops - 1, Math.floor(at)), t = at - i;
	const coarse = stopAt(i), fine = stopAt(i + 1);
	if (!ends || ends.coarse !== coarse || ends.fine !== fine)
		makeEnds(coarse, fine);
	blend(t);
	refresh(`between ${grouped(faces[coarse])} and ${grouped(faces[fine])} triangles, at ${t.toFixed(2)}`);
}

function showLevel(to)
{
	goTo(Math.max(0, Math.min(LAST, to)));
	ends = null;
	geometry.attributes.position.array.set(mesh.place);
	if (mesh.colour)
		geometry.attributes.color.array.set(mesh.colour);
	normalsAt(mesh.place, faces[level], geometry.attributes.normal.array);
	refresh(`${grouped(faces[level])} triangles, ${grouped(BASE + level)} vertices`);
}

function show(x)
{
	share = Math.max(0, Math.min(1, x));
	if (geomorph)
		showMorph();
	else
		showLevel(share === 1 ? LAST : levelOf(facesAtShare(share)));
}

/* So many splits on, or back. */
function step(n)
{
	const to = Math.max(0, Math.min(LAST, level + n));
	stop();
	if (geomorph)
		toggleMorph();
	share = Math.log(faces[to] / Math.max(faces[0], 1)) / Math.log(faces[LAST] / Math.max(faces[0], 1)) || 0;
	showLevel(to);
}

function toggleMorph()
{
	geomorph = toggle(byId('morph'));
	show(share);
}

/* ---- playing ------------------------------------------------------------------------------- */

const WHOLE_WAY = 12000; // milliseconds
let playing = 0; // 1: forward, -1: back

function stop()
{
	playing = 0;
	byId('play').setAttribute('aria-pressed', false);
	byId('back').setAttribute('aria-pressed', false);
}

function play(way)
{
	const again = playing === way;
	stop();
	if (again)
		return;
	playing = way;
	byId(way > 0 ? 'play' : 'back').setAttribute('aria-pressed', true);
	if (way > 0 ? share === 1 : share === 0)
		show(way > 0 ? 0 : 1);
	let last = performance.now();
	const on = now => {
		if (playing !== way)
			return;
		show(share + way * (now - last) / WHOLE_WAY);
		last = now;
		if (way > 0 ? share === 1 : share === 0)
			stop();
		else
			requestAnimationFrame(on);
	};
	requestAnimationFrame(on);
}

/* ---- begin --------------------------------------------------------------------------------- */

function boxOf(place)
{
	const lo = [Infinity, Infinity, Infinity], hi = [-Infinity, -Infinity, -Infinity];
	for (let i = 0; i < place.length; i++) {
		lo[i % 3] = Math.min(lo[i % 3], place[i]);
		hi[i % 3] = Math.max(hi[i % 3], place[i]);
	}
	return { lo, hi };
}

function putInSpace(place)
{
	const turned = TURNS[space.up];
	for (let i = 0; i < place.length; i += 3) {
		const [x, y, z] = [0, 1, 2].map(k => (place[i + k] - space.middle[k]) * space.scale);
		place.set(turned(x, y, z), i);
	}
}

function begin()
{
	fixSpace(boxOf(mesh.place));
	putInSpace(mesh.place);
	putInSpace(mesh.other);
	geometry = new THREE.BufferGeometry();
	geometry.setIndex(new THREE.BufferAttribute(mesh.corner, 1));
	geometry.setAttribute('position', new THREE.BufferAttribute(mesh.place.slice(), 3));
	geometry.setAttribute('normal', new THREE.BufferAttribute(new Float32Array(mesh.place.length), 3));
	if (mesh.colour) {
		geometry.setAttribute('color', new THREE.BufferAttribute(mesh.colour.slice(), 3));
		three.surface.vertexColors = true;
		three.surface.color.set(0xffffff);
	}
	three.solid.geometry = three.wires.geometry = geometry;
	three.solid.frustumCulled = three.wires.frustumCulled = false;
	show(1);
	byId('level').addEventListener('input', e => {
		stop();
		show(e.target.value / 1000);
	});
	byId('morph').addEventListener('click', toggleMorph);
	byId('play').addEventListener('click', () => play(1));
	byId('back').addEventListener('click', () => play(-1));
}

Object.assign(keys, {
	'.': () => step(1), ',': () => step(-1),
	']': () => { stop(); show(share + 1 / stops); }, '[': () => { stop(); show(share - 1 / stops); },
	g: toggleMorph, ' ': () => play(1), b: () => play(-1)
});
start(begin);
