// Put into the operator's page before its own scripts: notes when each decoded picture was drawn on a camera's canvas
// (`at`), and when the page began its next frame (`composed`), which shows the picture unless the canvas has a surface
// of its own (`surface`). The page knows nothing of it.
(() => {
  const probe = { shown: [], stream: null };
  const prototype = CanvasRenderingContext2D.prototype;
  const draw = prototype.drawImage;
  prototype.drawImage = function drawImage(image, ...place) {
    draw.call(this, image, ...place);
    const at = performance.now();
    const stream = this.canvas.dataset?.stream;
    if (stream === undefined || (probe.stream !== null && stream !== probe.stream)) return;
    const rtp = image instanceof VideoFrame ? image.metadata().rtpTimestamp : undefined;
    if (rtp === undefined) return;
    const surface = this.getContextAttributes().desynchronized;
    const entry = { rtp, at, composed: null, surface };
    probe.shown.push(entry);
    requestAnimationFrame(() => (entry.composed = performance.now()));
  };
  window.drawProbe = probe;
})();
