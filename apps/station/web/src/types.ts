// What the station's server answers.
export type Vec3 = [number, number, number];

export interface SurveyImage { file: string; camera: number; center: Vec3; rotation: [Vec3, Vec3, Vec3]; gantry?: Vec3 }
export interface Camera { id: string; width: number; height: number; fx: number; fy: number; cx: number; cy: number; residual_px: number | null }
export interface Survey { name: string; step: boolean; images: SurveyImage[]; cameras: Camera[]; warnings: string[]; version: string }

export interface Dimension { value: number; sigma: number | null; observable: boolean; origin?: string; nominal?: number }
export interface Match { image: string; line: number; edge: number; arc: boolean; residual_px: number | null }
export interface Part {
  id: string; kind: string; features?: string[]; designation?: string; standard?: string; designation_candidates?: string[]; source: 'automatic' | 'corrected' | 'manual';
  resting_pose: string; stands_on: string; residual_px: number | null; doubtful: boolean; log_odds: number;
  confirmed: boolean; doubt: string;
  pose: { position: Vec3; rotation: [Vec3, Vec3, Vec3]; yaw: number };
  dimensions: Record<string, Dimension>; dimension_order?: string[];
  vertices: Vec3[]; vertex_sigma: Vec3[]; edges: [number, number][];
  circles: { center: Vec3; normal: Vec3; radius: number }[];
  images: string[]; matches: Match[];
  runner_up?: { kind: string; log_odds: number };
}

// In the order in which the knowledge base has them: length first.
export function dimensionsOf(part: Part): [string, Dimension][] {
  return (part.dimension_order ?? Object.keys(part.dimensions)).filter((name) => name in part.dimensions).map((name) => [name, part.dimensions[name]]);
}

export interface Item { kind: string; id: string; value: unknown; version: number }
export interface Run { job?: 'survey' | 'calibration'; state: 'none' | 'running' | 'done' | 'failed' | 'cancelled'; step?: string; done?: number; total?: number; message?: string }
export interface Parameter { name: string; type: 'number' | 'integer' | 'bool'; unit: string; help: string; min: number; max: number; default: number; value: number }
export interface State {
  revision: number; since: number; items: Item[]; run: Run; stale: boolean; parameters: Parameter[];
  undo: { edit: number; label: string } | null; redo: { edit: number; label: string } | null;
}

// [number, u0, v0, u1, v1, contrast, sigma_px, points between where the lens bends the line...]
export type LineRow = number[];
// [number, u, v, a, b, angle, from, to, contrast]
export type ArcRow = number[];
export interface Lines { segments: LineRow[]; removed: LineRow[]; arcs: ArcRow[]; version: number; noise: number }

export interface Piece { source: 'edge' | 'circle' | 'limb'; index: number; hidden: boolean; points: number[] }
export interface Projection { parts: Record<string, { pieces: Piece[]; vertices: ([number, number, number] | null)[] }> }

export interface KnownObject {
  kind: string; title: string; resting_poses: string[]; variants: string[][]; cuts: string[];  // cuts: dimensions that can be divided
  dimensions: { name: string; min: number; max: number; usual: number; help: string }[];
}

export interface Pick { image: number; line: number; contour: number; circle: boolean; residual_px?: number | null }
export interface Hint { dimension: string; image: number; contour: number; circle: boolean }
export interface Fit { part: Part; picks: Pick[]; projections: Record<string, Piece[]>; hints: Hint[]; placed: boolean; rms_px: number | null; ms: number }

// How the picks may be read: the contour of each; best first.
export interface Proposal { readings: { contours: number[]; rms_px: number }[]; decided: boolean; ms: number }

export interface Cut { share: number; along: string; lengths: [number, number]; pieces: Piece[]; refused?: string }

export interface HistoryRow { revision: number; edit: number; action: 'edit' | 'undo' | 'redo'; who: string; when: string; label: string }
export interface Difference { kind: string; id: string; before: unknown; after: unknown }
export interface SceneSeam { parts: [string, string]; start: Vec3; end: Vec3 }
export interface ScenePart { id: string; triangles: number[]; vertices: Vec3[]; edges: [number, number][]; circles: { center: Vec3; normal: Vec3; radius: number }[] }

// The last calibration, and what may be calibrated.
export interface Calibration { job: string; model: string; findings: string[]; warnings: string[]; cameras: { id: string; residual_px: number | null; views: number | null; placed: boolean }[] }
export interface CalibrationJobs { jobs: string[]; parameters: Parameter[] }
export interface CamerasInUse { job: string; calibration: number; files: Record<string, string> }
