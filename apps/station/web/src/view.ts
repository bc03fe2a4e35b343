// Zoom and pan: how picture pixels become screen pixels.
export interface ViewBox { scale: number; x: number; y: number }  // screen = scale * picture + (x, y)

export const minScale = 0.05, maxScale = 80;

export function fitView(width: number, height: number, screenWidth: number, screenHeight: number): ViewBox {
  const scale = Math.max(minScale, Math.min(screenWidth / width, screenHeight / height) * 0.97);
  return { scale, x: (screenWidth - scale * width) / 2, y: (screenHeight - scale * height) / 2 };
}

// Zooms by `factor`; the picture point under (sx, sy) stays where it is.
export function zoomAt(view: ViewBox, factor: number, sx: number, sy: number): ViewBox {
  const scale = Math.min(maxScale, Math.max(minScale, view.scale * factor));
  const f = scale / view.scale;
  return { scale, x: sx - f * (sx - view.x), y: sy - f * (sy - view.y) };
}

// (0, 0) of a picture is the centre of its first pixel, whose corner lies at the view's origin.
export function toScreen(view: ViewBox, u: number, v: number): [number, number] {
  return [view.scale * (u + 0.5) + view.x, view.scale * (v + 0.5) + view.y];
}
export function toPicture(view: ViewBox, sx: number, sy: number): [number, number] {
  return [(sx - view.x) / view.scale - 0.5, (sy - view.y) / view.scale - 0.5];
}

// The view in which the box (picture px) fills most of the screen.
export function viewOfBox(u0: number, v0: number, u1: number, v1: number, screenWidth: number, screenHeight: number): ViewBox {
  const scale = Math.min(maxScale, 0.6 * Math.min(screenWidth / Math.max(20, u1 - u0), screenHeight / Math.max(20, v1 - v0)));
  return { scale, x: screenWidth / 2 - scale * ((u0 + u1) / 2 + 0.5), y: screenHeight / 2 - scale * ((v0 + v1) / 2 + 0.5) };
}
