// Notes when each step of a page's first connection was done, in ms since the navigation began.
(() => {
  const steps = (window.openingSteps = {});
  const note = (name) => (steps[name] ??= performance.now());
  window.RTCPeerConnection = class extends RTCPeerConnection {
    constructor(...given) {
      super(...given);
      note("connection made");
      this.addEventListener("iceconnectionstatechange", () => {
        if (this.iceConnectionState === "connected") note("ICE connected");
      });
      this.addEventListener("connectionstatechange", () => {
        if (this.connectionState === "connected") note("DTLS connected");
      });
    }
    async setRemoteDescription(...given) {
      await super.setRemoteDescription(...given);
      note("answer set");
    }
    createDataChannel(...given) {
      const channel = super.createDataChannel(...given);
      channel.addEventListener("open", () => note("channels open"));
      channel.addEventListener("message", ({ data }) => {
        if (String(data).includes('"feedback"')) note("first feedback");
      });
      return channel;
    }
  };
  const { fetch } = window;
  window.fetch = (where, ...how) => {
    if (String(where).includes("/whep")) note("offer sent");
    return fetch(where, ...how);
  };
})();
