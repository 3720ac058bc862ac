/** What has to be undone at the end: listeners, timers. */
export class Disposal {
  private readonly undos: (() => void)[] = [];

  add(undo: () => void): void {
    this.undos.push(undo);
  }

  listen<K extends keyof WindowEventMap>(
    target: Window,
    type: K,
    listener: (event: WindowEventMap[K]) => void,
    options?: AddEventListenerOptions,
  ): void {
    target.addEventListener(type, listener, options);
    this.add(() => target.removeEventListener(type, listener, options));
  }

  close(): void {
    for (const undo of this.undos.splice(0).reverse()) undo();
  }
}
