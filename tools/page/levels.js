/* The levels of a report, as mesh/compact wrote them. */

/* Corners and grid places: see src/mesh/compact.h for the bytes. */
function decode(bytes, nv, nf)
{
	const index = new Uint32Array(3 * nf), grid = new Uint16Array(3 * nv);
	const last = [0, 0, 0];
	let at = 0, met = 0;
	const number = () => {
		let n = 0, factor = 1, b;
		do {
			b = bytes[at++];
			n += (b & 127) * factor;
			factor *= 128;
		} while (b & 128);
		return n;
	};
	for (let i = 0; i < 3 * nf; i++) {
		const ago = number();
		const v = ago === 0 ? met++ : met - ago;
		for (let k = 0; k < 3; k++) {
			if (ago === 0) {
				const n = number();
				grid[3 * v + k] = last[k] + (n % 2 ? -(n + 1) / 2 : n / 2);
			}
			last[k] = grid[3 * v + k];
		}
		index[i] = v;
	}
	return { index, grid };
}

/* The box of a level, in the file's coordinates. */
function boxOf(level, grid)
{
	const lo = [Infinity, Infinity, Infinity], hi = [-Infinity, -Infinity, -Infinity];
	for (let i = 0; i < grid.length; i++) {
		lo[i % 3] = Math.min(lo[i % 3], grid[i]);
		hi[i % 3] = Math.max(hi[i % 3], grid[i]);
	}
	const there = (g, k) => level.origin[k] + level.step * g;
	return { lo: lo.map(there), hi: hi.map(there) };
}

function placesOf(level, grid)
{
	const out = new Float32Array(grid.length), turn = TURNS[space.up];
	const put = (g, k) => (level.origin[k] - space.middle[k] + level.step * g) * space.scale;
	for (let i = 0; i < grid.length; i += 3)
		out.set(turn(put(grid[i], 0), put(grid[i + 1], 1), put(grid[i + 2], 2)), i);
	return out;
}

const made = []; // geometries

function geometryOf(i)
{
	if (made[i])
		return made[i];
	const level = data.levels[i];
	const { index, grid } = decode(bytesOf('mesh-' + i), level.shown_vertices, level.shown_faces);
	if (!space)
		fixSpace(boxOf(level, grid));
	const g = new THREE.BufferGeometry();
	g.setIndex(new THREE.BufferAttribute(index, 1));
	g.setAttribute('position', new THREE.BufferAttribute(placesOf(level, grid), 3));
	g.computeVertexNormals();
	made[i] = g;
	return g;
}

let shown = -1;

function show(i)
{
	const level = data.levels[i];
	if (i === shown || !level)
		return;
	three.solid.geometry = three.wires.geometry = geometryOf(i);
	shown = i;
	byId('count').textContent = level.shown_faces === level.faces ? grouped(level.faces) + ' triangles'
		: grouped(level.shown_faces) + ' triangles, reduced for this page from ' + grouped(level.faces);
	byId('levels').querySelectorAll('input')[i].checked = true;
	redraw();
}

function listLevels()
{
	data.levels.forEach((level, i) => {
		const label = document.createElement('label'), input = document.createElement('input');
		input.type = 'radio';
		input.name = 'level';
		input.value = i;
		input.addEventListener('change', () => show(i));
		label.append(input, level.name);
		byId('levels').append(label);
	});
}

keys['['] = () => show(shown - 1);
keys[']'] = () => show(shown + 1);
start(() => {
	listLevels();
	show(0);
});
