import type { TileKind } from "../tile_state";
import { svg } from "../../ui/elements/dom";

/** One shape for each state, so that colour is not the only sign. In a square of 16. */
const SHAPES: Readonly<Record<TileKind, string>> = {
  trouble: "M8 1.5 15 14H1Zm-.9 4.7.3 4h1.2l.3-4Zm.9 5a1 1 0 1 0 0 2 1 1 0 0 0 0-2Z",
  unreachable: "m3.4 2 4.6 4.6L12.6 2 14 3.4 9.4 8l4.6 4.6-1.4 1.4L8 9.4 3.4 14 2 12.6 6.6 8 2 3.4Z",
  unknown:
    "M8 1a7 7 0 1 0 0 14A7 7 0 0 0 8 1Zm0 2.6c1.6 0 2.7 1 2.7 2.3 0 1.7-1.8 1.9-1.8 3.2H7.1c0-2.2 1.7-2.2 1.7-3.1 0-.4-.3-.7-.8-.7s-.9.4-1 1l-1.7-.3c.2-1.5 1.2-2.4 2.7-2.4Zm0 6.3a1.1 1.1 0 1 1 0 2.2 1.1 1.1 0 0 1 0-2.2Z",
  stopped: "M5 1h6l4 4v6l-4 4H5l-4-4V5Z",
  silent:
    "M3 6.5a1.5 1.5 0 1 0 0 3 1.5 1.5 0 0 0 0-3Zm5 0a1.5 1.5 0 1 0 0 3 1.5 1.5 0 0 0 0-3Zm5 0a1.5 1.5 0 1 0 0 3 1.5 1.5 0 0 0 0-3Z",
  behind: "M8 2v12L1 8Zm7 0v12L8 8Z",
  driven: "M3 1.5 14 8 3 14.5Z",
  free: "M8 1.5a6.5 6.5 0 1 0 0 13 6.5 6.5 0 0 0 0-13Zm0 2a4.5 4.5 0 1 1 0 9 4.5 4.5 0 0 1 0-9Z",
};

export interface TileIcon {
  readonly element: SVGSVGElement;
  show(kind: TileKind): void;
}

export function createTileIcon(): TileIcon {
  const path = svg("path", { "fill-rule": "evenodd", fill: "currentColor" });
  const element = svg("svg", { viewBox: "0 0 16 16", "aria-hidden": "true", class: "tile-icon" });
  element.append(path);
  return {
    element,
    show(kind) {
      if (path.getAttribute("d") !== SHAPES[kind]) path.setAttribute("d", SHAPES[kind]);
    },
  };
}
