import { button, h } from "./dom";

/** A dialogue: its content, and what happens when it opens and closes. */
export interface SheetContent {
  readonly name: string; // "invite", also its class
  readonly title: string;
  readonly element: HTMLElement;
  opened(): void;
  closed(): void;
}

/**
 * One dialogue at a time, over the pictures. Everything else is inert but the control seat, the banner and STOP: a
 * modal `<dialog>` would shut these out too. Escape stops the robot wherever the focus is, and closes the dialogue.
 */
export class Sheets {
  readonly element = h("div", "sheet-layer");
  private current: { content: SheetContent; dialog: HTMLDialogElement; opener: Element | null } | null = null;

  /** `behind`: what is inert while a dialogue is open; `hint`: what Escape does meanwhile. */
  constructor(
    private readonly behind: () => Iterable<HTMLElement>,
    private readonly hint = "Esc stops the robot",
  ) {
    this.element.hidden = true;
    this.element.addEventListener("click", (event) => {
      if (event.target === this.element) this.close();
    });
  }

  get isOpen(): boolean {
    return this.current !== null;
  }

  open(content: SheetContent): void {
    this.close();
    const heading = h("h2", "sheet-title", { id: "sheet-title" }, content.title);
    const close = button("sheet-close", "Close", () => this.close());
    const head = h("header", "sheet-head", {}, heading, h("span", "sheet-hint", {}, this.hint), close);
    const dialog = h("dialog", `sheet ${content.name}`, { "aria-labelledby": "sheet-title" });
    dialog.append(head, content.element);
    this.current = { content, dialog, opener: document.activeElement };
    this.element.replaceChildren(dialog);
    this.element.hidden = false;
    for (const part of this.behind()) part.inert = true;
    dialog.show();
    content.opened();
  }

  close(): void {
    const { current } = this;
    if (current === null) return;
    this.current = null;
    for (const part of this.behind()) part.inert = false;
    current.dialog.close();
    this.element.hidden = true;
    this.element.replaceChildren();
    current.content.closed();
    if (current.opener instanceof HTMLElement) current.opener.focus();
  }
}
