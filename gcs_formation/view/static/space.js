// The flight in three dimensions, by three.js: east is x, up is y, north is -z. Loaded when it is first looked at.
"use strict";
class Space {
  constructor(place, store) {
    this.store = store;
    this.place = place;
    this.ready = false;
    this.camera = null;
    this.centre = [0, 0, 0];
    this.following = true;
  }

  get visible() { return this.ready && !this.canvas.hidden; }

  async show(visible) {
    if (this.ready) { this.canvas.hidden = !visible; return true; }
    if (!visible) return true;
    if (typeof THREE === "undefined" && !(await load("static/vendor/three.min.js"))) return false;
    try {
      this.build();
    } catch (error) {
      this.canvas?.remove();
      return false; // no WebGL here
    }
    return true;
  }

  build() {
    this.canvas = element("canvas", { class: "space", tabindex: "0", "aria-label": "The flight in three dimensions" });
    this.place.append(this.canvas);
    this.renderer = new THREE.WebGLRenderer({ canvas: this.canvas, antialias: true });
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(45, 1, 1, 200000);
    this.camera.position.set(-120, 90, 160);
    this.controls = new THREE.OrbitControls(this.camera, this.canvas);
    this.controls.maxPolarAngle = Math.PI * 0.495;
    this.scene.add(new THREE.AmbientLight(0xffffff, 1.6));
    const sun = new THREE.DirectionalLight(0xffffff, 1.8);
    sun.position.set(-1, 2, -1);
    this.scene.add(sun);
    const count = this.store.vehicles.length, cone = new THREE.ConeGeometry(0.5, 1.6, 5);
    cone.rotateX(-Math.PI / 2);
    cone.scale(1.4, 0.35, 1);
    this.bodies = new THREE.InstancedMesh(cone, new THREE.MeshLambertMaterial({ color: 0xffffff }), count);
    this.bodies.frustumCulled = false;
    this.scene.add(this.bodies);
    this.rings = this.lines(0.9);
    this.drops = this.lines(0.35);
    this.pairs = this.lines(1);
    this.tracks = this.lines(0.8);
    this.fixed = new THREE.Group();
    this.scene.add(this.fixed);
    this.matrix = new THREE.Matrix4();
    this.turn = new THREE.Quaternion();
    this.up = new THREE.Vector3(0, 1, 0);
    this.ready = true;
    this.fitted = false;
    this.drawnTheme = null;
    this.drawnTracks = 0;
  }

  // Line segments whose points and colours change.
  lines(opacity) {
    const found = new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ vertexColors: true, transparent: true, opacity }));
    found.frustumCulled = false;
    this.scene.add(found);
    return found;
  }

  set(lines, points, colours) {
    const geometry = lines.geometry, size = points.length;
    const position = geometry.getAttribute("position");
    if (!position || position.array.length < size) {
      geometry.dispose();
      for (const name of ["position", "color"]) geometry.setAttribute(name, new THREE.BufferAttribute(new Float32Array(size * 2), 3).setUsage(THREE.DynamicDrawUsage));
    }
    geometry.getAttribute("position").array.set(points);
    geometry.getAttribute("color").array.set(colours);
    geometry.getAttribute("position").needsUpdate = geometry.getAttribute("color").needsUpdate = true;
    geometry.setDrawRange(0, size / 3);
  }

  fitFormation(places) {
    const box = boxOf(places), heights = places.map((each) => each[2]).filter(Number.isFinite);
    if (!box || !heights.length || !this.ready) return;
    const reach = Math.max(40, box.north[1] - box.north[0], box.east[1] - box.east[0]);
    this.centre = [(box.east[0] + box.east[1]) / 2, (Math.min(...heights) + Math.max(...heights)) / 2, -(box.north[0] + box.north[1]) / 2];
    this.controls.target.set(...this.centre);
    this.camera.position.set(this.centre[0] - 0.7 * reach, this.centre[1] + 0.75 * reach, this.centre[2] + 1.3 * reach);
    this.following = true;
    this.fitted = true;
  }

  zoom(factor) {
    const offset = this.camera.position.clone().sub(this.controls.target).multiplyScalar(1 / factor);
    this.camera.position.copy(this.controls.target).add(offset);
  }

  draw(view) {
    const { clientWidth: width, clientHeight: height } = this.canvas, ratio = Math.min(2, window.devicePixelRatio || 1);
    if (!width) return;
    if (this.width !== width || this.height !== height || this.ratio !== ratio) {
      [this.width, this.height, this.ratio] = [width, height, ratio];
      this.renderer.setPixelRatio(ratio);
      this.renderer.setSize(width, height, false);
      this.camera.aspect = width / height;
      this.camera.updateProjectionMatrix();
    }
    if (!this.fitted) this.fitFormation(view.places);
    if (this.drawnTheme !== view.colours.dark) this.still(view);
    this.follow(view);
    this.vehicles(view);
    if (performance.now() - this.drawnTracks > 500) this.past(view);
    this.controls.update();
    this.renderer.render(this.scene, this.camera);
  }

  follow(view) {
    const [north, east] = view.centre;
    if (!this.following || !Number.isFinite(north)) return;
    const centre = [east, view.height, -north];
    const moved = centre.map((each, i) => each - this.centre[i]);
    this.centre = centre;
    this.controls.target.set(...centre);
    this.camera.position.set(this.camera.position.x + moved[0], this.camera.position.y + moved[1], this.camera.position.z + moved[2]);
  }

  vehicles(view) {
    const { store } = this, size = Math.max(4, this.camera.position.distanceTo(this.controls.target) / 45);
    const drops = [], dropColours = [], rings = [], ringColours = [], pairs = [], pairColours = [], colour = new THREE.Color();
    for (let v = 0; v < store.vehicles.length; v++) {
      const [north, east, height, heading] = view.places[v];
      colour.set(colourOf(store, v, view.colours));
      const known = Number.isFinite(north) && Number.isFinite(heading), scale = known ? size : 0;
      this.turn.setFromAxisAngle(this.up, known ? -heading : 0);
      this.matrix.compose(new THREE.Vector3(known ? east : 0, known ? height : 0, known ? -north : 0), this.turn, new THREE.Vector3(scale, scale, scale));
      this.bodies.setMatrixAt(v, this.matrix);
      this.bodies.setColorAt(v, colour);
      if (!known) continue;
      drops.push(east, height, -north, east, view.floor, -north);
      dropColours.push(colour.r, colour.g, colour.b, colour.r, colour.g, colour.b);
      const slot = view.slots[v];
      if (Number.isFinite(slot[0])) this.ring(rings, ringColours, slot, size, colour);
    }
    for (const pair of view.pairs) {
      const [a, b] = [view.places[pair.a], view.places[pair.b]];
      colour.set(pair.distance < pair.limit ? view.colours.bad : view.colours.warn);
      pairs.push(a[1], a[2], -a[0], b[1], b[2], -b[0]);
      pairColours.push(colour.r, colour.g, colour.b, colour.r, colour.g, colour.b);
    }
    this.bodies.instanceMatrix.needsUpdate = true;
    if (this.bodies.instanceColor) this.bodies.instanceColor.needsUpdate = true;
    this.set(this.drops, drops, dropColours);
    this.set(this.rings, rings, ringColours);
    this.set(this.pairs, pairs, pairColours);
  }

  ring(points, colours, [north, east, height], size, colour) {
    for (let i = 0; i < 12; i++) {
      for (const k of [i, i + 1]) {
        points.push(east + size * Math.cos((k * TURN) / 12), height, -north + size * Math.sin((k * TURN) / 12));
        colours.push(colour.r, colour.g, colour.b);
      }
    }
  }

  past(view) {
    const { store } = this, ticks = store.overview, end = ticks.before(view.time_s) + 1, points = [], colours = [], colour = new THREE.Color();
    for (let v = 0; v < store.vehicles.length; v++) {
      colour.set(colourOf(store, v, view.colours));
      for (let i = 1; i < end; i++) {
        const a = (i - 1) * ticks.width + v * store.width, b = i * ticks.width + v * store.width, values = ticks.values;
        if (!Number.isFinite(values[a]) || !Number.isFinite(values[b])) continue;
        points.push(values[a + 1], values[a + 2], -values[a], values[b + 1], values[b + 2], -values[b]);
        colours.push(colour.r, colour.g, colour.b, colour.r, colour.g, colour.b);
      }
    }
    this.set(this.tracks, points, colours);
    this.drawnTracks = performance.now();
  }

  // Path, fence and ground, which change with the theme alone.
  still(view) {
    this.drawnTheme = view.colours.dark;
    this.scene.background = new THREE.Color(view.colours.paper);
    this.fixed.clear();
    const scene = this.store.meta.scene;
    const points = (path) => path.flatMap(([north, east, height]) => [east, height ?? view.floor, -north]);
    const line = (values, colour) => {
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(values), 3));
      this.fixed.add(new THREE.Line(geometry, new THREE.LineBasicMaterial({ color: colour })));
    };
    if (scene.path && scene.path.length) line(points(scene.path), view.colours.faint);
    for (const area of scene.fence || []) {
      for (const height of [view.floor, ...(scene.heights || []).filter((each) => each !== null)]) line(points(area.corners.map(([n, e]) => [n, e, height])), view.colours.bad);
    }
    if (scene.ground) this.terrain(scene.ground, view); else this.flat(view);
  }

  flat(view) {
    const box = boxOf([...(this.store.meta.scene.path || []), ...view.places]) || { north: [-500, 500], east: [-500, 500] };
    const step = niceStep(Math.max(box.north[1] - box.north[0], box.east[1] - box.east[0], 400) / 20), values = [];
    const [south, north] = [Math.floor(box.north[0] / step - 4) * step, Math.ceil(box.north[1] / step + 4) * step];
    const [west, east] = [Math.floor(box.east[0] / step - 4) * step, Math.ceil(box.east[1] / step + 4) * step];
    for (let n = south; n <= north; n += step) values.push(west, view.floor, -n, east, view.floor, -n);
    for (let e = west; e <= east; e += step) values.push(e, view.floor, -south, e, view.floor, -north);
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(values), 3));
    this.fixed.add(new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color: view.colours.line })));
  }

  terrain(ground, view) {
    const rows = ground.height.length / ground.columns, positions = [], index = [];
    for (let row = 0; row < rows; row++) {
      for (let column = 0; column < ground.columns; column++) {
        positions.push(ground.west + column * ground.cell, ground.height[row * ground.columns + column] ?? view.floor, -(ground.south + row * ground.cell));
        if (row && column) {
          const d = row * ground.columns + column, c = d - 1, b = d - ground.columns, a = b - 1;
          index.push(a, b, c, b, d, c);
        }
      }
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(positions), 3));
    geometry.setIndex(index);
    geometry.computeVertexNormals();
    this.fixed.add(new THREE.Mesh(geometry, new THREE.MeshLambertMaterial({ color: view.colours.dark ? 0x4d5648 : 0xc9c6a5, side: THREE.DoubleSide })));
  }

  project(v, view) {
    const [north, east, height] = view.places[v];
    if (!Number.isFinite(north)) return null;
    const point = new THREE.Vector3(east, height, -north).project(this.camera);
    return point.z < 1 ? [((point.x + 1) / 2) * this.width, ((1 - point.y) / 2) * this.height] : null;
  }
}

function load(address) {
  return new Promise((resolve) => {
    const script = element("script", { src: address });
    script.onload = () => resolve(true);
    script.onerror = () => resolve(false);
    document.head.append(script);
  });
}
