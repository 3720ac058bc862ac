import { describe, expect, it } from "vitest";
import { drawsInHardware, readChoice, sceneAnswer, type SceneFacts } from "../../src/scene/scene_preference";

const HARDWARE = "ANGLE (Intel, Mesa Intel(R) UHD Graphics 620 (KBL GT2), OpenGL 4.6)";
const ROOMY: SceneFacts = {
  choice: null,
  described: true,
  small: false,
  savesData: false,
  megabits: 10,
  limited: false,
  pictureAgeMs: 5000,
  armed: false,
  renderer: HARDWARE,
};

describe("the 3D scene that nobody has asked for", () => {
  it("comes where the machine draws in hardware, the screen is large and the network wide", () => {
    expect(sceneAnswer(ROOMY)).toBe("show");
    expect(sceneAnswer({ ...ROOMY, megabits: null })).toBe("show");
  });

  it("stays away where the processor would have to draw it", () => {
    expect(sceneAnswer({ ...ROOMY, renderer: null })).toBe("none");
    for (const renderer of [
      "ANGLE (Google, Vulkan 1.3.0 (SwiftShader Device (Subzero) (0x0000C0DE)), SwiftShader driver)",
      "llvmpipe (LLVM 15.0.7, 256 bits)",
      "llvmpipe, or similar",
      "softpipe",
      "Microsoft Basic Render Driver",
      "Apple Software Renderer",
    ])
      expect([renderer, sceneAnswer({ ...ROOMY, renderer })]).toEqual([renderer, "none"]);
  });

  it("stays away from small screens, from who saves data and from a network that carries little", () => {
    const against: Partial<SceneFacts>[] = [
      { small: true },
      { savesData: true },
      { megabits: 1.9 },
      { limited: true },
    ];
    for (const fact of against)
      for (const renderer of [HARDWARE, null, undefined])
        expect([fact, sceneAnswer({ ...ROOMY, ...fact, renderer })]).toEqual([fact, "none"]);
  });

  it("comes after the first picture and its sound, and asks what draws no earlier", () => {
    expect(sceneAnswer({ ...ROOMY, pictureAgeMs: null, renderer: undefined })).toBe("wait");
    expect(sceneAnswer({ ...ROOMY, pictureAgeMs: 1999, renderer: undefined })).toBe("wait");
    expect(sceneAnswer({ ...ROOMY, pictureAgeMs: 2000, renderer: undefined })).toBe("ask");
  });

  it("does not come while somebody drives", () => {
    expect(sceneAnswer({ ...ROOMY, armed: true })).toBe("wait");
    expect(sceneAnswer({ ...ROOMY, armed: true, choice: "shown" })).toBe("wait");
  });
});

describe("the 3D scene that somebody has decided about", () => {
  it("comes on request whatever the machine is, but after the pictures", () => {
    const weak: SceneFacts = { ...ROOMY, choice: "shown", small: true, savesData: true, megabits: 0.1 };
    for (const renderer of [undefined, null, "llvmpipe"])
      expect(sceneAnswer({ ...weak, renderer })).toBe("show");
    expect(sceneAnswer({ ...weak, pictureAgeMs: null })).toBe("wait");
  });

  it("stays hidden on a machine that could draw it", () => {
    expect(sceneAnswer({ ...ROOMY, choice: "hidden" })).toBe("none");
  });

  it("is never of a robot that does not say its shape", () => {
    for (const choice of [null, "shown", "hidden"] as const)
      expect(sceneAnswer({ ...ROOMY, described: false, choice })).toBe("none");
  });

  it("reads what was kept, and takes anything else for no decision", () => {
    expect([null, "", "shown", "hidden", "SHOWN", "{}"].map(readChoice)).toEqual([
      null,
      null,
      "shown",
      "hidden",
      null,
      null,
    ]);
  });
});

it("graphics hardware is told by its name from what draws with the processor", () => {
  for (const name of [
    "Apple GPU",
    "NVIDIA GeForce GTX 980, or similar",
    "ANGLE (AMD, AMD Radeon 780M)",
    "Mali-G78",
  ])
    expect([name, drawsInHardware(name)]).toEqual([name, true]);
});
