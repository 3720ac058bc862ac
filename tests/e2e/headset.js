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
  let standsStill = false;
  let held = null; // the emulator's own, meanwhile
  window.requestAnimationFrame = (callback) => {
    if (standsStill && callback.name === "onDeviceFrame") {
      held = callback;
      return 0;
    }
    if (!silent || callback.name === "onDeviceFrame") return request(callback);
    silenced.push(callback);
    return -silenced.length;
  };
  for (const [name, shown, hidden] of [
    ["hidden", false, true],
    ["visibilityState", "visible", "hidden"],
  ])
    Object.defineProperty(document, name, {
      configurable: true,
      get: () => (silent ? hidden : shown),
    });

  // A pose is lost, or its place only guessed, as the test says.
  const lost = new Set(); // "left", "right", "viewer"
  const guessed = new Set();
  const sideOf = (space) =>
    ["left", "right"].find((side) =>
      [device.controllers[side], device.hands[side]].some(
        ({ inputSource }) =>
          inputSource.gripSpace === space ||
          inputSource.targetRaySpace === space,
      ),
    );
  const sideOfJoint = (joint) =>
    ["left", "right"].find((side) =>
      [...device.hands[side].inputSource.hand.values()].includes(joint),
    );
  const prototype = window.XRFrame.prototype;
  const { getPose, getJointPose, getViewerPose } = prototype;
  const doubted = (pose, name) => {
    if (lost.has(name)) return null;
    // The emulator calls all places guessed, since it has made them up.
    Object.defineProperty(pose, "emulatedPosition", {
      get: () => guessed.has(name),
    });
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

  // What the motors were told, oldest first.
  const pulses = [];
  for (const side of ["left", "right"])
    for (const actuator of device.controllers[side].inputSource.gamepad
      .hapticActuators)
      actuator.pulse = (value, duration) => {
        pulses.push({ side, value, duration });
        return Promise.resolve(true);
      };

  const battery = Object.assign(new EventTarget(), {
    level: 1,
    charging: false,
  });
  navigator.getBattery = () => Promise.resolve(battery);

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
    pulses,
    right: device.controllers.right,
    /** The session has no frames, as when the headset's compositor hangs. */
    standStill(on) {
      standsStill = on;
      if (!on && held !== null) request(held);
      held = null;
    },
    lowBattery(on) {
      battery.level = on ? 0.04 : 1;
      battery.dispatchEvent(new Event("levelchange"));
    },
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
      const hand =
        device.primaryInputMode === "hand"
          ? device.hands[side]
          : device.controllers[side];
      hand.position.set(x, y, z);
      const [a, b] = [Math.sin(left / 2), Math.cos(left / 2)];
      const [c, d] = [Math.sin(up / 2), Math.cos(up / 2)];
      hand.quaternion.set(b * c, a * d, -a * c, b * d);
      return frames(3);
    },
    /** Points the controller at a place: m to the right, up and ahead of the eyes of who looks along -z. */
    aim(side, right, up, ahead) {
      const hand = device.controllers[side];
      const [x, y, z] = [
        right - hand.position.x,
        up + device.position.y - hand.position.y,
        -ahead - hand.position.z,
      ];
      const [left, tilt] = [
        Math.atan2(-x, -z),
        Math.atan2(y, Math.hypot(x, z)),
      ];
      return this.place(
        side,
        [hand.position.x, hand.position.y, hand.position.z],
        left,
        tilt,
      );
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
    /** The mean colour around a place of the eyes' picture, as shares of its width and height from the top left. */
    async area(x, y) {
      const { appCanvas } = device;
      const gl = appCanvas.getContext("webgl2");
      const [width, height] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
      const size = 8;
      const found = new Uint8Array(4 * size * size);
      // In a frame of the session, behind the page's own callback: what that has drawn is still there.
      await new Promise((done) => {
        device.activeSession.requestAnimationFrame(() => {
          const place = [
            Math.floor(x * width) - size / 2,
            Math.floor((1 - y) * height) - size / 2,
          ];
          gl.readPixels(...place, size, size, gl.RGBA, gl.UNSIGNED_BYTE, found);
          done();
        });
      });
      return [0, 1, 2, 3].map((part) => {
        const values = found.filter((_value, at) => at % 4 === part);
        return values.reduce((sum, value) => sum + value, 0) / values.length;
      });
    },
    watched: [],
    /** Notes at each frame, behind the page's own callback, how far the picture is behind and whether it is veiled. */
    watch(stream) {
      const step = () => {
        device.activeSession?.requestAnimationFrame(step);
        const s = lockstep.stats();
        const shown = lockstep.rendered(stream).at(-1)?.stamp ?? null;
        const panel = s.headset?.panels.find(({ left }) => left === stream);
        if (shown !== null && panel !== undefined)
          this.watched.push({ gap: s.event - shown, veil: panel.veil });
      };
      device.activeSession.requestAnimationFrame(step);
    },
  };
})();
