/** A part of the page that shows the console's state when asked to. */
export interface Panel {
  readonly element: HTMLElement;
  update(now: number): void;
}

type Attributes = Readonly<Record<string, string>>;

/** One element with its class, attributes and children. */
export function h<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  className = "",
  attributes: Attributes = {},
  ...children: (Node | string)[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  if (className !== "") element.className = className;
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...children);
  return element;
}

/** A button that does nothing else than `onclick`. */
export function button(className: string, label: string, onclick: () => void): HTMLButtonElement {
  const element = h("button", className, { type: "button" }, label);
  element.addEventListener("click", onclick);
  return element;
}

/** Writes only what changed: a write costs a layout even when it is the same. */
export function setText(node: Node, text: string): void {
  if (node.textContent !== text) node.textContent = text;
}

export function setData(element: HTMLElement, name: string, value: string): void {
  if (element.dataset[name] !== value) element.dataset[name] = value;
}

export function setHidden(element: HTMLElement, hidden: boolean): void {
  if (element.hidden !== hidden) element.hidden = hidden;
}

export function setPressed(element: HTMLElement, pressed: boolean): void {
  if (element.getAttribute("aria-pressed") !== String(pressed))
    element.setAttribute("aria-pressed", String(pressed));
}

export function svg<K extends keyof SVGElementTagNameMap>(
  tag: K,
  attributes: Attributes,
): SVGElementTagNameMap[K] {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  return element;
}

/** "1 284 013": digits in groups, to be read at a glance. */
export function grouped(value: number): string {
  return String(value).replace(/\B(?=(\d{3})+$)/g, "\u202f");
}

/** "64 ms", or a dash while unknown. */
export function milliseconds(value: number | null): string {
  if (value === null) return "–";
  return value < 9.95 ? value.toFixed(1) : value.toFixed(0);
}
