// Distance meters of two makers, read by Bluetooth where the browser offers it: Chrome and Edge, on
// pages that came encrypted or from this very machine. Both say metres as a float of four bytes,
// the lowest first. Whatever else a meter says (areas, angles, sums) is no reading.

export const METERS = [
  {
    maker: "Leica DISTO",
    service: "3ab10100-f831-4395-b29d-570977d5bf94",
    value: "3ab10101-f831-4395-b29d-570977d5bf94",
    metres: (data) => (data.byteLength >= 4 ? data.getFloat32(0, true) : NaN),
  },
  {
    maker: "Bosch GLM or PLR",
    service: "02a6c0d0-0451-4000-b000-fb3210111989",
    value: "02a6c0d1-0451-4000-b000-fb3210111989",
    start: [0xc0, 0x55, 0x02, 0x01, 0x00, 0x1a], // tell each measurement as it is taken
    metres: glmMetres,
  },
];

// A message that begins C0 55 10 and is of a single length (mode 1, in the upper six bits).
export function glmMetres(data) {
  const head = data.byteLength >= 11 && data.getUint8(0) === 0xc0 && data.getUint8(1) === 0x55 && data.getUint8(2) === 0x10;
  return head && data.getUint8(3) >> 2 === 1 ? data.getFloat32(7, true) : NaN;
}

export function whyNoMeter() {
  if (navigator.bluetooth) return "";
  const how = window.isSecureContext ? "This browser cannot read a meter by Bluetooth; Chrome and Edge can." : "A page can read a meter by Bluetooth only if the laptop serves it with --tls.";
  return `${how} A meter with a keyboard mode types into the page.`;
}

// Let the person choose a meter; `got` hears each length in metres, `tell` how it stands.
export async function connectMeter(got, tell) {
  try {
    const device = await navigator.bluetooth.requestDevice({
      filters: [...METERS.map((one) => ({ services: [one.service] })), { namePrefix: "DISTO" }, { namePrefix: "Bosch" }],
      optionalServices: METERS.map((one) => one.service),
    });
    device.addEventListener("gattserverdisconnected", () => tell(`${device.name}: the link is lost; connect it once more.`));
    const server = await device.gatt.connect();
    for (const meter of METERS) {
      const service = await server.getPrimaryService(meter.service).catch(() => null);
      if (!service) continue;
      const value = await service.getCharacteristic(meter.value);
      await value.startNotifications();
      value.addEventListener("characteristicvaluechanged", (event) => {
        const metres = meter.metres(event.target.value);
        if (Number.isFinite(metres) && metres > 0) got(metres);
      });
      if (meter.start) await value.writeValue(Uint8Array.from(meter.start));
      tell(`${device.name || meter.maker} is connected: each measurement is entered as it is taken.`);
      return;
    }
    tell(`${device.name}: no meter that this page can read. Its keyboard mode types into the page.`);
  } catch (error) {
    tell(error.name === "NotFoundError" ? "No meter was chosen." : `The meter cannot be reached (${error.message}). Switch its Bluetooth on, and try again.`);
  }
}
