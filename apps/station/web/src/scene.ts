// The parts as solids on the ground, with cameras and gantry stops.
import * as THREE from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { SVGRenderer } from 'three/addons/renderers/SVGRenderer.js';
import type { ScenePart, SceneSeam, Survey, Vec3 } from './types';

interface Shown { id: string; group: THREE.Group; cap: THREE.Mesh | null; mesh: THREE.Mesh | null; edges: THREE.LineSegments; vertices: THREE.Points; colour: THREE.Color; data: ScenePart }
export interface VertexPick { part: string; vertex: number }

const reachPx = 14;
const noClip = 1e9;      // mm: a section farther away cuts nothing
const hatchMm = 90;      // between the lines on the face of a cut

// Slanted lines, as drawings show what was cut.
function hatch(): THREE.Texture {
  const canvas = document.createElement('canvas'), side = 32;
  canvas.width = canvas.height = side;
  const c = canvas.getContext('2d')!;
  c.fillStyle = '#fff';
  c.fillRect(0, 0, side, side);
  c.strokeStyle = '#555';
  c.lineWidth = 3;
  for (const x of [-side, 0, side]) { c.beginPath(); c.moveTo(x, side); c.lineTo(x + side, 0); c.stroke(); }
  const texture = new THREE.CanvasTexture(canvas);
  texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
  texture.colorSpace = THREE.SRGBColorSpace;
  return texture;
}

// Where to look, and from how far, so that all points are seen as large as may be. `tan`: of half the angle of view, upright.
function nearest(points: THREE.Vector3[], axes: { back: THREE.Vector3; right: THREE.Vector3; up: THREE.Vector3 }, tan: number, aspect: number) {
  const target = new THREE.Box3().setFromPoints(points).getCenter(new THREE.Vector3()), d = new THREE.Vector3(), margin = 1.1;
  const rounds = 4;  // each moves the target to the middle of what is seen, which changes the distance a little
  let distance = 100;
  for (let round = 0; round < rounds; round++) {
    distance = 100;
    for (const p of points) {
      d.subVectors(p, target);
      distance = Math.max(distance, d.dot(axes.back) + margin * Math.max(Math.abs(d.dot(axes.up)) / tan, Math.abs(d.dot(axes.right)) / (tan * aspect)));
    }
    if (round === rounds - 1) break;
    for (const axis of [axes.right, axes.up]) {
      const at = points.map((p) => { d.subVectors(p, target); return d.dot(axis) / (distance - d.dot(axes.back)); });
      target.addScaledVector(axis, ((Math.min(...at) + Math.max(...at)) / 2) * distance);
    }
  }
  return { target, distance };
}

export class SceneDrawing {
  readonly webgl: boolean;
  private renderer: THREE.WebGLRenderer | SVGRenderer;
  private scene = new THREE.Scene();
  private camera = new THREE.PerspectiveCamera(40, 1, 10, 200000);
  private controls: OrbitControls;
  private shown: Shown[] = [];
  private cameras = new THREE.Group();
  private frusta: THREE.LineSegments[] = [];
  private centers: THREE.Vector3[] = [];  // of the cameras
  private marks = new THREE.Group();
  private readonly seams = new THREE.Group();
  private ground = new THREE.Group();
  private clip = new THREE.Plane(new THREE.Vector3(0, 0, -1), noClip);
  private readonly capPlane = new THREE.PlaneGeometry(1, 1);
  private capOrder = 0;
  private extent = new THREE.Box3();
  private height = 1000;
  private measuring = false;
  private frame = 0;
  private placed = false;
  private down: [number, number] | null = null;

  constructor(private box: HTMLElement, select: (id: string) => void, hover: (id: string) => void, vertex: (v: VertexPick) => void) {
    let renderer: THREE.WebGLRenderer | null = null;
    try {
      const gl = document.createElement('canvas').getContext('webgl2');
      if (gl) renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true, stencil: true });
    } catch { renderer = null; }
    this.webgl = renderer !== null;
    this.renderer = renderer ?? new SVGRenderer();
    if (renderer) { renderer.setPixelRatio(Math.min(2, devicePixelRatio)); renderer.localClippingEnabled = true; }
    this.renderer.domElement.setAttribute('aria-hidden', 'true');
    box.append(this.renderer.domElement);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, box);
    this.controls.maxPolarAngle = Math.PI * 0.495;
    this.controls.zoomToCursor = true;
    this.controls.addEventListener('change', () => this.ask());
    this.scene.add(new THREE.HemisphereLight(0xdbeaf5, 0x2a3138, 2.1));
    const sun = new THREE.DirectionalLight(0xffffff, 2.2);
    sun.position.set(-0.5, -0.8, 1.4);
    this.scene.add(sun, this.ground, this.cameras, this.seams, this.marks);
    box.addEventListener('pointerdown', (e) => { this.down = [e.clientX, e.clientY]; });
    box.addEventListener('pointerup', (e) => {
      if (!this.down || Math.hypot(e.clientX - this.down[0], e.clientY - this.down[1]) > 4) return;
      if (this.measuring) { const v = this.vertexAt(e); if (v) vertex(v); } else select(this.partAt(e));
    });
    box.addEventListener('pointermove', (e) => { if (e.buttons === 0) hover(this.partAt(e)); });
    box.addEventListener('pointerleave', () => hover(''));
    this.resize();
  }

  dispose() {
    this.controls.dispose();
    if (this.renderer instanceof THREE.WebGLRenderer) { this.renderer.dispose(); this.renderer.forceContextLoss(); }
    this.renderer.domElement.remove();
  }

  resize() {
    const w = Math.max(1, this.box.clientWidth), h = Math.max(1, this.box.clientHeight);
    this.camera.aspect = w / h;
    this.camera.updateProjectionMatrix();
    this.renderer.setSize(w, h);
    this.ask();
  }

  setParts(parts: ScenePart[], colourOf: (id: string) => string, survey: Survey) {
    for (const s of this.shown) this.scene.remove(s.group);
    this.extent.makeEmpty();
    this.capOrder = 0;
    this.shown = parts.map((p) => this.makePart(p, new THREE.Color(colourOf(p.id))));
    for (const s of this.shown) this.scene.add(s.group);
    if (this.cameras.children.length === 0) this.makeCameras(survey);
    if (this.extent.isEmpty()) {
      for (const im of survey.images) this.extent.expandByPoint(new THREE.Vector3(im.center[0], im.center[1], 0));
      this.extent.expandByVector(new THREE.Vector3(500, 500, 0));
    }
    this.height = Math.max(100, this.extent.max.z);
    this.makeGround();
    if (!this.placed && parts.length > 0) { this.placed = true; this.home(); }
    this.ask();
  }

  private makePart(p: ScenePart, colour: THREE.Color): Shown {
    const group = new THREE.Group();
    const points = p.vertices.map((v) => new THREE.Vector3(...v));
    for (const v of points) this.extent.expandByPoint(v);
    let mesh: THREE.Mesh | null = null, cap: THREE.Mesh | null = null;
    if (p.triangles.length > 0) {
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute('position', new THREE.Float32BufferAttribute(p.triangles, 3));
      geometry.computeVertexNormals();
      geometry.computeBoundingBox();
      this.extent.union(geometry.boundingBox!);
      const material = new THREE.MeshStandardMaterial({ color: colour.clone().lerp(new THREE.Color('#aab4bb'), 0.35), roughness: 0.75, metalness: 0.15, side: THREE.DoubleSide, clippingPlanes: [this.clip], polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 1 });
      mesh = new THREE.Mesh(geometry, material);
      mesh.userData.part = p.id;
      group.add(mesh);
      if (this.webgl) cap = this.makeCap(group, geometry, colour);
    }
    const ends: number[] = [];
    for (const [a, b] of p.edges) ends.push(...p.vertices[a], ...p.vertices[b]);
    for (const c of p.circles) {
      const normal = new THREE.Vector3(...c.normal).normalize(), u = new THREE.Vector3(Math.abs(normal.x) < 0.9 ? 1 : 0, Math.abs(normal.x) < 0.9 ? 0 : 1, 0).projectOnPlane(normal).normalize(), v = normal.clone().cross(u);
      for (let k = 0; k < 48; k++) for (const a of [(k * Math.PI) / 24, ((k + 1) * Math.PI) / 24]) {
        const q = new THREE.Vector3(...c.center).addScaledVector(u, c.radius * Math.cos(a)).addScaledVector(v, c.radius * Math.sin(a));
        ends.push(q.x, q.y, q.z);
        this.extent.expandByPoint(q);
      }
    }
    const lines = new THREE.BufferGeometry();
    lines.setAttribute('position', new THREE.Float32BufferAttribute(ends, 3));
    const edges = new THREE.LineSegments(lines, new THREE.LineBasicMaterial({ color: '#0b1115', clippingPlanes: [this.clip] }));
    const vertices = new THREE.Points(new THREE.BufferGeometry().setFromPoints(points), new THREE.PointsMaterial({ color: '#ffffff', size: 7, sizeAttenuation: false, depthTest: false }));
    vertices.visible = false;
    group.add(edges, vertices);
    return { id: p.id, group, cap, mesh, edges, vertices, colour, data: p };
  }

  // The face of the cut. Where a ray through the clipped solid meets more back faces than front faces, the cut lies inside
  // it: the stencil counts them, and the cap is drawn where the count is not zero (as in three.js' example clipping_stencil).
  private makeCap(group: THREE.Group, geometry: THREE.BufferGeometry, colour: THREE.Color): THREE.Mesh {
    const order = 1 + 2 * this.capOrder++;
    for (const [side, op] of [[THREE.BackSide, THREE.IncrementWrapStencilOp], [THREE.FrontSide, THREE.DecrementWrapStencilOp]] as const) {
      const count = new THREE.Mesh(geometry, new THREE.MeshBasicMaterial({ side, clippingPlanes: [this.clip], colorWrite: false, depthWrite: false, depthTest: false, stencilWrite: true, stencilFunc: THREE.AlwaysStencilFunc, stencilFail: op, stencilZFail: op, stencilZPass: op }));
      count.renderOrder = order;
      group.add(count);
    }
    const cap = new THREE.Mesh(this.capPlane, new THREE.MeshBasicMaterial({ color: colour, map: hatch(), side: THREE.DoubleSide, stencilWrite: true, stencilRef: 0, stencilFunc: THREE.NotEqualStencilFunc, stencilFail: THREE.ReplaceStencilOp, stencilZFail: THREE.ReplaceStencilOp, stencilZPass: THREE.ReplaceStencilOp }));
    cap.renderOrder = order + 1;
    cap.onAfterRender = (renderer) => renderer.clearStencil();
    cap.visible = false;
    group.add(cap);
    return cap;
  }
  private placeCaps() {
    const reach = Math.max(1000, this.extent.getSize(new THREE.Vector3()).length()), center = this.extent.getCenter(new THREE.Vector3());
    for (const { cap } of this.shown) {
      if (!cap) continue;
      cap.visible = this.clip.constant < noClip;
      if (!cap.visible) continue;
      this.clip.projectPoint(center, cap.position);
      cap.scale.setScalar(reach);
      cap.lookAt(cap.position.clone().sub(this.clip.normal));
      const map = (cap.material as THREE.MeshBasicMaterial).map!;
      map.repeat.setScalar(reach / hatchMm);
    }
  }

  private makeGround() {
    this.ground.clear();
    const size = this.extent.getSize(new THREE.Vector3()), span = Math.max(size.x, size.y, 1000) * 1.6, step = 10 ** Math.floor(Math.log10(span / 4));
    const grid = new THREE.GridHelper(Math.ceil(span / step) * step, Math.ceil(span / step), '#4b6679', '#2a3c49');
    grid.rotation.x = Math.PI / 2;
    const c = this.extent.getCenter(new THREE.Vector3());
    grid.position.set(Math.round(c.x / step) * step, Math.round(c.y / step) * step, -0.5);
    this.ground.add(grid, new THREE.AxesHelper(step));
  }

  private makeCameras(survey: Survey) {
    const stops = new Set<string>();
    for (const im of survey.images) {
      const camera = survey.cameras[im.camera], reach = 260, p: number[] = [];
      const corner = (u: number, v: number): Vec3 => {
        const d = [((u - camera.cx) / camera.fx) * reach, ((v - camera.cy) / camera.fy) * reach, reach];
        return [0, 1, 2].map((k) => im.center[k] + im.rotation[0][k] * d[0] + im.rotation[1][k] * d[1] + im.rotation[2][k] * d[2]) as Vec3;
      };
      const corners = [corner(0, 0), corner(camera.width, 0), corner(camera.width, camera.height), corner(0, camera.height)];
      corners.forEach((q, i) => p.push(...im.center, ...q, ...q, ...corners[(i + 1) % 4]));
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute('position', new THREE.Float32BufferAttribute(p, 3));
      const frustum = new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color: '#5f8aa6' }));
      this.frusta.push(frustum);
      this.centers.push(new THREE.Vector3(...im.center));
      this.cameras.add(frustum);
      if (im.gantry) stops.add(im.gantry.join());
    }
    for (const stop of stops) {  // where the carriage stood, on the ground below the mean of its cameras
      const at = survey.images.filter((im) => im.gantry?.join() === stop), mean = [0, 1].map((k) => at.reduce((sum, im) => sum + im.center[k], 0) / at.length);
      const mark = new THREE.Mesh(new THREE.RingGeometry(50, 70, 24), new THREE.MeshBasicMaterial({ color: '#ffb454', side: THREE.DoubleSide }));
      mark.position.set(mean[0], mean[1], 1);
      this.cameras.add(mark);
    }
  }

  highlight(selected: string, hovered: string) {
    for (const s of this.shown) {
      const on = s.id === selected, over = s.id === hovered;
      if (s.mesh) (s.mesh.material as THREE.MeshStandardMaterial).emissive.copy(s.colour).multiplyScalar(on ? 0.55 : over ? 0.28 : 0);
      (s.edges.material as THREE.LineBasicMaterial).color.set(on ? '#ffffff' : over ? '#cfe8f5' : this.webgl ? '#0b1115' : '#' + s.colour.getHexString());
    }
    this.ask();
  }
  highlightCamera(image: number) {
    this.frusta.forEach((f, i) => (f.material as THREE.LineBasicMaterial).color.set(i === image ? '#35d0ba' : '#5f8aa6'));
    this.ask();
  }
  showCameras(yes: boolean) { this.cameras.visible = yes; this.ask(); }
  // 100: whole; below, everything beyond that share of the workpiece along the axis is cut away. Where that is, mm; null: nowhere.
  setSection(axis: 'x' | 'y' | 'z', percent: number): number | null {
    const low = axis === 'z' ? 0 : this.extent.min[axis], high = axis === 'z' ? this.height : this.extent.max[axis];
    this.clip.normal.set(axis === 'x' ? -1 : 0, axis === 'y' ? -1 : 0, axis === 'z' ? -1 : 0);
    this.clip.constant = percent >= 100 ? noClip : low + ((high - low) * percent) / 100 + 0.01;
    this.placeCaps();
    this.ask();
    return percent >= 100 ? null : this.clip.constant;
  }
  setMeasuring(yes: boolean) { this.measuring = yes; for (const s of this.shown) s.vertices.visible = yes; this.ask(); }
  setMarks(marks: VertexPick[]) {
    this.marks.clear();
    const at = marks.map((m) => this.shown.find((s) => s.id === m.part)?.data.vertices[m.vertex]).filter((v) => v !== undefined).map((v) => new THREE.Vector3(...v));
    const points = new THREE.Points(new THREE.BufferGeometry().setFromPoints(at), new THREE.PointsMaterial({ color: '#ff5d8f', size: 13, sizeAttenuation: false, depthTest: false }));
    this.marks.add(points);
    if (at.length === 2) this.marks.add(new THREE.Line(new THREE.BufferGeometry().setFromPoints(at), new THREE.LineBasicMaterial({ color: '#ff5d8f', depthTest: false })));
    this.ask();
  }

  // Where parts touch: in red, over everything.
  setSeams(seams: SceneSeam[]) {
    this.seams.clear();
    const ends = seams.flatMap((s) => [...s.start, ...s.end]), geometry = new THREE.BufferGeometry();
    geometry.setAttribute('position', new THREE.Float32BufferAttribute(ends, 3));
    this.seams.add(new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color: '#ff4d4d', depthTest: false })));
    this.ask();
  }

  private look(direction: THREE.Vector3) {
    const back = direction.normalize(), right = new THREE.Vector3(0, 0, 1).cross(back).normalize(), up = back.clone().cross(right);
    const points = this.shown.flatMap((s) => [...s.data.vertices, ...s.data.circles.map((c) => c.center)]).map((v) => new THREE.Vector3(...v));
    if (this.cameras.visible) points.push(...this.centers);
    if (points.length === 0) points.push(this.extent.min, this.extent.max);
    const { target, distance } = nearest(points, { back, right, up }, Math.tan(((this.camera.fov * Math.PI) / 180) * 0.5), this.camera.aspect);
    this.controls.target.copy(target);
    this.camera.position.copy(target).addScaledVector(back, distance);
    this.camera.near = distance / 100; this.camera.far = distance * 20;
    this.camera.updateProjectionMatrix();
    this.controls.update();
    this.ask();
  }
  home() { this.look(new THREE.Vector3(-0.55, -0.75, 0.62)); }
  top() { this.look(new THREE.Vector3(0, -0.001, 1)); }

  zoom(factor: number) {
    this.camera.position.sub(this.controls.target).divideScalar(factor).add(this.controls.target);
    this.controls.update();
    this.ask();
  }
  // About the upright, and towards it, rad.
  turn(about: number, down: number) {
    const from = new THREE.Spherical().setFromVector3(this.camera.position.clone().sub(this.controls.target).applyAxisAngle(new THREE.Vector3(1, 0, 0), -Math.PI / 2));
    from.theta += about;
    from.phi = Math.min(this.controls.maxPolarAngle, Math.max(0.01, from.phi + down));
    this.camera.position.setFromSpherical(from).applyAxisAngle(new THREE.Vector3(1, 0, 0), Math.PI / 2).add(this.controls.target);
    this.controls.update();
    this.ask();
  }

  private ray(e: PointerEvent): THREE.Raycaster {
    const r = this.box.getBoundingClientRect(), ray = new THREE.Raycaster();
    ray.setFromCamera(new THREE.Vector2(((e.clientX - r.left) / r.width) * 2 - 1, -((e.clientY - r.top) / r.height) * 2 + 1), this.camera);
    return ray;
  }
  private partAt(e: PointerEvent): string {
    const meshes = this.shown.map((s) => s.mesh).filter((m) => m !== null);
    const hit = this.ray(e).intersectObjects(meshes, false).find((h) => this.clip.distanceToPoint(h.point) >= 0);
    return (hit?.object.userData.part as string | undefined) ?? '';
  }
  private vertexAt(e: PointerEvent): VertexPick | null {
    const r = this.box.getBoundingClientRect();
    let best: VertexPick | null = null, least = e.pointerType === 'touch' ? 2 * reachPx : reachPx;
    for (const s of this.shown) s.data.vertices.forEach((v, i) => {
      const p = new THREE.Vector3(...v).project(this.camera);
      if (p.z > 1) return;
      const distance = Math.hypot(((p.x + 1) / 2) * r.width - (e.clientX - r.left), ((1 - p.y) / 2) * r.height - (e.clientY - r.top));
      if (distance < least) { least = distance; best = { part: s.id, vertex: i }; }
    });
    return best;
  }

  private ask() {
    if (this.frame) return;
    this.frame = requestAnimationFrame(() => { this.frame = 0; this.renderer.render(this.scene, this.camera); this.box.dataset.parts = String(this.shown.length); });
  }
}
