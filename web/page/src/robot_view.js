// The robot on its obstacle, with an arrow for every contact force. World: z up, metres.
import {
  AmbientLight, BoxGeometry, CanvasTexture, CapsuleGeometry, Color, CylinderGeometry, ConeGeometry,
  DirectionalLight, Group, HemisphereLight, Mesh, MeshStandardMaterial, MeshBasicMaterial,
  PCFShadowMap, PerspectiveCamera, PlaneGeometry, Quaternion, RepeatWrapping, Scene,
  SphereGeometry, SRGBColorSpace, Vector3, WebGLRenderer,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

const METRES_PER_NEWTON = 0.0018;
const SHOWN_FORCE = 2; // N
const OBSTACLE_FORCE = 0x16964c;
const FLOOR_FORCE = 0x8c3cbe;

const vector = (v) => new Vector3(v[0], v[1], v[2]);
const rotation = (q) => new Quaternion(q[1], q[2], q[3], q[0]); // ours: w x y z

function shapeOf(geom) {
  if (geom.shape === "box") return new BoxGeometry(...geom.half.map((h) => 2 * h));
  if (geom.shape === "sphere") return new SphereGeometry(geom.radius, 24, 16);
  // three's capsules lie along y, ours along z.
  return new CapsuleGeometry(geom.radius, geom.length, 8, 20).rotateX(Math.PI / 2);
}

function checkered() {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 64;
  const paint = canvas.getContext("2d");
  paint.fillStyle = "#dfe4ea";
  paint.fillRect(0, 0, 64, 64);
  paint.fillStyle = "#d2d8e0";
  paint.fillRect(0, 0, 32, 32);
  paint.fillRect(32, 32, 32, 32);
  const texture = new CanvasTexture(canvas);
  texture.wrapS = texture.wrapT = RepeatWrapping;
  texture.colorSpace = SRGBColorSpace;
  return texture;
}

class ForceArrow {
  constructor(colour) {
    const material = new MeshBasicMaterial({ color: colour, depthTest: false, transparent: true });
    this.shaft = new Mesh(new CylinderGeometry(0.008, 0.008, 1, 12).rotateX(Math.PI / 2), material);
    this.head = new Mesh(new ConeGeometry(0.022, 0.05, 16).rotateX(Math.PI / 2), material);
    this.group = new Group().add(this.shaft, this.head);
    this.group.renderOrder = this.shaft.renderOrder = this.head.renderOrder = 1;
  }
  show(from, force) {
    this.group.visible = force > SHOWN_FORCE;
    const length = force * METRES_PER_NEWTON;
    this.group.position.copy(from);
    this.shaft.scale.z = Math.max(length - 0.04, 1e-3);
    this.shaft.position.z = this.shaft.scale.z / 2;
    this.head.position.z = Math.max(length - 0.02, 0.02);
  }
}

export class RobotView {
  constructor(canvas) {
    this.canvas = canvas;
    this.renderer = new WebGLRenderer({ canvas, antialias: true });
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.scene = new Scene();
    this.scene.background = new Color(0xf7f9fb);
    this.camera = new PerspectiveCamera(30, 1, 0.05, 50);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener("change", () => this.ask());
    this.addSurroundings();
    this.world = new Group();
    this.scene.add(this.world);
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement);
  }

  addSurroundings() {
    const floor = new Mesh(
      new PlaneGeometry(8, 8),
      new MeshStandardMaterial({ map: checkered(), roughness: 1 }),
    );
    floor.material.map.repeat.set(16, 16); // squares of 0.25 m
    floor.receiveShadow = true;
    const sun = new DirectionalLight(0xffffff, 2.2);
    sun.position.set(-1.2, 2, 3.2);
    sun.castShadow = true;
    sun.shadow.mapSize.set(1024, 1024);
    Object.assign(sun.shadow.camera, { left: -2, right: 2, top: 2, bottom: -2, near: 0.5, far: 8 });
    this.scene.add(floor, sun, new HemisphereLight(0xffffff, 0xb8c0ca, 1.1), new AmbientLight(0xffffff, 0.35));
  }

  /** Builds what `scene` describes in place of what was there. */
  load(scene) {
    this.world.clear();
    this.description = scene;
    for (const box of scene.obstacles) this.addObstacle(box);
    this.joints = [];
    this.bodies = scene.bodies.map((body) => this.addBody(body));
    scene.bodies.forEach((body, b) => {
      (body.parent < 0 ? this.world : this.bodies[body.parent]).add(
        body.parent < 0 ? this.bodies[b] : this.bodies[b].parent,
      );
    });
    for (const geom of scene.geoms) this.addGeom(geom);
    this.arrows = scene.contacts.map(() => [new ForceArrow(OBSTACLE_FORCE), new ForceArrow(FLOOR_FORCE)]);
    for (const pair of this.arrows) for (const arrow of pair) this.world.add(arrow.group);
    this.lookAtAll(scene);
    this.resize();
  }

  addObstacle(box) {
    const mesh = new Mesh(
      new BoxGeometry(...box.half.map((h) => 2 * h)),
      new MeshStandardMaterial({ color: 0xc4925c, roughness: 0.8 }),
    );
    mesh.position.copy(vector(box.center));
    mesh.rotation.z = box.yaw;
    mesh.castShadow = mesh.receiveShadow = true;
    this.world.add(mesh);
  }

  /** A body hangs in the fixed frame of its joint and turns about the joint's axis in it. */
  addBody(body) {
    const turned = new Group();
    turned.rotation.order = "XYZ";
    if (body.parent >= 0) {
      const frame = new Group().add(turned);
      frame.position.copy(vector(body.p));
      frame.quaternion.copy(rotation(body.R));
      this.joints.push({ turned, axis: vector(body.axis) });
    }
    return turned;
  }

  addGeom(geom) {
    const mesh = new Mesh(
      shapeOf(geom),
      new MeshStandardMaterial({ color: geom.colour, roughness: 0.55 }),
    );
    mesh.position.copy(vector(geom.p));
    mesh.quaternion.copy(rotation(geom.R));
    mesh.castShadow = mesh.receiveShadow = true;
    this.bodies[geom.body].add(mesh);
  }

  /** From the left, above and a little behind, so that hands, knees and edge all show. */
  lookAtAll(scene) {
    const box = scene.obstacles[0];
    const middle = box ? vector(box.center).multiplyScalar(0.5) : new Vector3();
    const height = scene.height ?? 1;
    middle.z = 0.4 * height;
    const away = 3.1 * height;
    const azimuth = (scene.yaw ?? 0) + 1.9;
    this.controls.target.copy(middle);
    this.camera.position.set(
      middle.x + away * Math.cos(azimuth), middle.y + away * Math.sin(azimuth), middle.z + 0.3 * away);
    this.controls.update();
  }

  /** Shows one row of a run. */
  show(run, row) {
    const base = this.bodies[0];
    const at = (i) => run.value(row, "base", i);
    base.position.set(at(0), at(1), at(2));
    base.quaternion.set(at(4), at(5), at(6), at(3)).normalize();
    this.joints.forEach(({ turned, axis }, j) => {
      turned.quaternion.setFromAxisAngle(axis, run.value(row, "q", j));
    });
    this.world.updateMatrixWorld(true);
    this.description.contacts.forEach((contact, c) => {
      const from = this.touchPoint(contact);
      this.arrows[c][0].show(from, run.value(row, "force_obstacle", c));
      this.arrows[c][1].show(from, run.value(row, "force_floor", c));
    });
    this.ask();
  }

  /** Below the link's sphere, or the middle of its sole. */
  touchPoint(contact) {
    const sum = new Vector3();
    for (const point of contact.points) sum.add(this.bodies[contact.body].localToWorld(vector(point)));
    sum.multiplyScalar(1 / Math.max(1, contact.points.length));
    sum.z -= contact.radius;
    return sum;
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    if (width === 0 || height === 0) return;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.ask();
  }

  /** Draws with the next picture; asked for again before then, once. */
  ask() {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => {
      this.asked = false;
      this.renderer.render(this.scene, this.camera);
      this.canvas.dataset.pictures = Number(this.canvas.dataset.pictures ?? 0) + 1;
    });
  }
}
