// A headset that a test puts on, moves and takes off: window.testHeadset, on top of iwer's emulated runtime.
(() => {
  if (window !== window.top) return;
  const device = new IWER.XRDevice(IWER.metaQuest3, { stereoEnabled: true });
  device.installRuntime({ forceInstall: true });
  device.position.set(0, 1.6, 0);

  // Headsets stop the window's frames during a session, and may call its document hidden. The emulator's own frames go
  // on: it asks for them by a function of this name.
  const request = window.requestAnimationFrame.bind(window);
  let silent = false;
  let silenced = [];
  window.requestAnimationFrame = (callback) => {
    if (!silent || callback.name === "onDeviceFrame") return request(callback);
    silenced.push(callback);
    return -silenced.length;
  };
  for (const [name, shown, hidden] of [
    ["hidden", false, true],
    ["visibilityState", "visible", "hidden"],
  ])
    Object.defineProperty(document, name, { configurable: true, get: () => (silent ? hidden : shown) });

  // A pose is lost, or its place only guessed, as the test says.
  const lost = new Set(); // "left", "right", "viewer"
  const guessed = new Set();
  const sideOf = (space) =>
    ["left", "right"].find((side) =>
      [device.controllers[side], device.hands[side]].some(
        ({ inputSource }) => inputSource.gripSpace === space || inputSource.targetRaySpace === space,
      ),
    );
  const sideOfJoint = (joint) =>
    ["left", "right"].find((side) => [...device.hands[side].inputSource.hand.values()].includes(joint));
  const prototype = window.XRFrame.prototype;
  const { getPose, getJointPose, getViewerPose } = prototype;
  const doubted = (pose, name) => {
    if (lost.has(name)) return null;
    // The emulator calls all places guessed, since it has made them up.
    Object.defineProperty(pose, "emulatedPosition", { get: () => guessed.has(name) });
    return pose;
  };
  prototype.getPose = function (space, base) {
    return doubted(getPose.call(this, space, base), sideOf(space));
  };
  prototype.getJointPose = function (joint, base) {
    return doubted(getJointPose.call(this, joint, base), sideOfJoint(joint));
  };
  prototype.getViewerPose = function (space) {
    return doubted(getViewerPose.call(this, space), "viewer");
  };

  const frames = (count) =>
    new Promise((done) => {
      const step = () => {
        if (count-- <= 0) done();
        else device.activeSession.requestAnimationFrame(step);
      };
      step();
    });

  window.testHeadset = {
    device,
    lost,
    guessed,
    silenced: () => silenced.length,
    silence(on) {
      silent = on;
      document.dispatchEvent(new Event("visibilitychange"));
      if (on) return;
      for (const callback of silenced) request(callback);
      silenced = [];
    },
    /** After the page has seen what was done before. */
    seen: () => frames(3),
    press(side, button, value = 1) {
      device.controllers[side].updateButtonValue(button, value);
      return frames(3);
    },
    tilt(side, x, y) {
      device.controllers[side].updateAxes("thumbstick", x, y);
      return frames(3);
    },
    /** Where the controller is, m, and where it looks: turned to the left and up, rad. */
    place(side, [x, y, z], left = 0, up = 0) {
      const hand = device.primaryInputMode === "hand" ? device.hands[side] : device.controllers[side];
      hand.position.set(x, y, z);
      const [a, b] = [Math.sin(left / 2), Math.cos(left / 2)];
      const [c, d] = [Math.sin(up / 2), Math.cos(up / 2)];
      hand.quaternion.set(b * c, a * d, -a * c, b * d);
      return frames(3);
    },
    look(left, up = 0) {
      const [a, b] = [Math.sin(left / 2), Math.cos(left / 2)];
      const [c, d] = [Math.sin(up / 2), Math.cos(up / 2)];
      device.quaternion.set(b * c, a * d, -a * c, b * d);
      return frames(3);
    },
    visibility(state) {
      device.updateVisibilityState(state);
    },
    end: () => device.activeSession.end(),
    /** Colours of both eyes where a place in the room is seen: no, of the canvas at a share of its width and height. */
    async pixel(x, y) {
      const { appCanvas } = device;
      const gl = appCanvas.getContext("webgl2");
      const found = new Uint8Array(4);
      // In the session's frame, behind the page's own callback: its picture is still in the buffer.
      await new Promise((done) => {
        device.activeSession.requestAnimationFrame(() => {
          gl.readPixels(
            Math.floor(x * gl.drawingBufferWidth),
            Math.floor((1 - y) * gl.drawingBufferHeight),
            ...[1, 1, gl.RGBA, gl.UNSIGNED_BYTE, found],
          );
          done();
        });
      });
      return [...found];
    },
  };
})();
