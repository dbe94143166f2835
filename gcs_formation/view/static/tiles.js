// A map beneath the plan, from a server that the viewer was started with; without one nothing is fetched.
"use strict";
const MAX_TILES = 256; // kept
const TILE_PIXELS = 256;
const MAX_ZOOM = 19;
const EARTH = { semiMajor_m: 6378137, squeezed: 0.00669437999014 }; // WGS 84: semi-major axis, squared eccentricity

// Radii of the meridian and of the parallel at a latitude, m.
function radii(lat) {
  const squeeze = 1 - EARTH.squeezed * Math.sin(lat) ** 2, across = EARTH.semiMajor_m / Math.sqrt(squeeze);
  return { meridian: (across * (1 - EARTH.squeezed)) / squeeze, parallel: across * Math.cos(lat) };
}

// Where a place is on the map: its share of the web Mercator square, from 180 degrees west, and from the north.
function mercator(lat, lon) {
  return [0.5 + lon / TURN, 0.5 - Math.log(Math.tan(Math.PI / 4 + lat / 2)) / TURN];
}

class Tiles {
  constructor(meta, arrived) {
    this.address = meta.tiles || null;
    this.arrived = arrived;
    this.images = new Map();
    const origin = meta.scene.origin;
    if (!origin) this.address = null;
    else { [this.lat, this.lon] = origin.map((degrees) => (degrees * Math.PI) / 180); this.radii = radii(this.lat); }
  }

  share(north, east) { return mercator(this.lat + north / this.radii.meridian, this.lon + east / this.radii.parallel); }

  north(y) { return (2 * Math.atan(Math.exp(Math.PI - TURN * y)) - Math.PI / 2 - this.lat) * this.radii.meridian; }

  east(x) { return (TURN * (x - 0.5) - this.lon) * this.radii.parallel; }

  // Draw the tiles of a rectangle of metres, about one pixel of theirs to one of the screen.
  draw(context, at, box, scale) {
    if (!this.address) return;
    const metres = TURN * this.radii.parallel, zoom = Math.max(0, Math.min(MAX_ZOOM, Math.round(Math.log2((metres * scale) / TILE_PIXELS)))), count = 2 ** zoom;
    const [west, north] = this.share(box.north[1], box.east[0]), [east, south] = this.share(box.north[0], box.east[1]);
    const columns = [Math.floor(west * count), Math.floor(east * count)], rows = [Math.floor(north * count), Math.floor(south * count)];
    if ((columns[1] - columns[0] + 1) * (rows[1] - rows[0] + 1) > MAX_TILES) return;
    for (let row = Math.max(0, rows[0]); row <= Math.min(count - 1, rows[1]); row++) {
      for (let column = columns[0]; column <= columns[1]; column++) {
        const image = this.image(zoom, ((column % count) + count) % count, row);
        if (!image.complete || !image.naturalWidth) continue;
        const [x, y] = at([this.north(row / count), this.east(column / count)]), [right, bottom] = at([this.north((row + 1) / count), this.east((column + 1) / count)]);
        context.drawImage(image, x, y, right - x + 0.5, bottom - y + 0.5); // half a pixel more, so that no seam shows
      }
    }
  }

  image(z, x, y) {
    const key = `${z} ${x} ${y}`, known = this.images.get(key);
    if (known) return known;
    if (this.images.size >= MAX_TILES) this.images.delete(this.images.keys().next().value);
    const image = new Image();
    image.referrerPolicy = "no-referrer";
    image.onload = () => this.arrived();
    image.src = this.address.replaceAll("{z}", z).replaceAll("{x}", x).replaceAll("{y}", y);
    this.images.set(key, image);
    return image;
  }
}
