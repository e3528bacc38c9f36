// Certificates as a PDF, drawn on this device: no name leaves it. Loaded on demand, since the
// library is larger than the page.

import {
  type PDFDocument,
  type PDFFont,
  type PDFImage,
  type PDFPage,
  PDFDocument as Pdf,
  rgb,
  StandardFonts,
} from "pdf-lib";
import hat from "../../../../server/assets/symbols/role-chef.svg?raw";
import type { Certificate } from "./certificate";

/** A4, landscape, in points. */
const WIDTH = 842;
const HEIGHT = 595;
const MARGIN = 90;
const INK = rgb(0.17, 0.14, 0.13);
const SOFT = rgb(0.4, 0.34, 0.29);
const GOLD = rgb(0.88, 0.63, 0);
/** The drawing is 48 units wide. */
const HAT_SCALE = 1.6;
const HAT_UNITS = 48;

/** A text as a picture (PNG), for scripts that the fonts of PDF lack; null without a canvas. */
export type Picture = (text: string, bold: boolean, size: number) => Promise<Uint8Array | null>;

/** The certificates as a PDF with a page for each. */
export async function certificatesPdf(
  certificates: readonly Certificate[],
  picture: Picture = pictureOf,
): Promise<Uint8Array> {
  const pdf = await Pdf.create();
  pdf.setTitle([...new Set(certificates.map(({ title, tournament }) => `${title} · ${tournament}`))].join(", "));
  const plain = await pdf.embedFont(StandardFonts.Helvetica);
  const bold = await pdf.embedFont(StandardFonts.HelveticaBold);
  for (const certificate of certificates) {
    const page = pdf.addPage([WIDTH, HEIGHT]);
    drawFrame(page);
    const write = (text: string, y: number, size: number, options: { bold?: boolean; color?: typeof INK } = {}) =>
      drawCentred({ pdf, page, picture, text, y, size, font: options.bold ? bold : plain, ...options });
    await write(certificate.title, 430, 30, { color: SOFT });
    await write(certificate.name, 355, 48, { bold: true });
    await write(certificate.achieved, 300, 22);
    await write(certificate.tournament, 262, 26, { bold: true });
    for (const [index, line] of certificate.lines.entries()) await write(line, 218 - 22 * index, 14, { color: SOFT });
    page.drawLine({ start: { x: WIDTH / 2 - 110, y: 110 }, end: { x: WIDTH / 2 + 110, y: 110 }, color: SOFT });
    await write(certificate.signature, 92, 12, { color: SOFT });
  }
  return pdf.save();
}

function drawFrame(page: PDFPage): void {
  const frame = (inset: number, borderWidth: number, borderColor: typeof INK) =>
    page.drawRectangle({
      x: inset,
      y: inset,
      width: WIDTH - 2 * inset,
      height: HEIGHT - 2 * inset,
      borderWidth,
      borderColor,
    });
  frame(28, 3, GOLD);
  frame(36, 1, INK);
  const x = (WIDTH - HAT_UNITS * HAT_SCALE) / 2;
  for (const [, fill, path] of hat.matchAll(/<path(?: fill="#(\w{6})")? d="([^"]+)"/g)) {
    page.drawSvgPath(path ?? "", {
      x,
      y: 548,
      scale: HAT_SCALE,
      borderColor: INK,
      borderWidth: 2,
      ...(fill && { color: colourOf(fill) }),
    });
  }
}

function colourOf(hex: string) {
  const [red = 0, green = 0, blue = 0] = [0, 2, 4].map((at) => Number.parseInt(hex.slice(at, at + 2), 16) / 255);
  return rgb(red, green, blue);
}

interface Line {
  pdf: PDFDocument;
  page: PDFPage;
  picture: Picture;
  text: string;
  /** Height of the base line above the lower edge. */
  y: number;
  size: number;
  font: PDFFont;
  bold?: boolean;
  color?: typeof INK;
}

/** Draws a line in the middle of the page, smaller if it would be too wide. */
async function drawCentred({ pdf, page, picture, text, y, size, font, bold = false, color = INK }: Line) {
  const room = WIDTH - 2 * MARGIN;
  if (isWritable(font, text)) {
    const fitting = Math.min(size, (size * room) / Math.max(1, font.widthOfTextAtSize(text, size)));
    const x = (WIDTH - font.widthOfTextAtSize(text, fitting)) / 2;
    page.drawText(text, { x, y, size: fitting, font, color });
    return;
  }
  const png = await picture(text, bold, size);
  if (!png)
    return drawCentred({ ...{ pdf, page, picture, y, size, font, bold, color }, text: withoutOthers(font, text) });
  const image: PDFImage = await pdf.embedPng(png);
  const scale = Math.min(1 / PIXELS, room / image.width);
  page.drawImage(image, {
    x: (WIDTH - image.width * scale) / 2,
    // The picture has the base line at this part of its height.
    y: y - image.height * scale * DESCENT,
    width: image.width * scale,
    height: image.height * scale,
  });
}

function isWritable(font: PDFFont, text: string): boolean {
  try {
    font.encodeText(text);
    return true;
  } catch {
    return false;
  }
}

/** The text with a question mark for each character that the font lacks. */
function withoutOthers(font: PDFFont, text: string): string {
  return [...text].map((character) => (isWritable(font, character) ? character : "?")).join("");
}

/** Pixels of a picture per point. */
const PIXELS = 4;
/** The part of a picture below the base line, and its height in sizes of the font. */
const DESCENT = 0.3;
const LINE = 1.5;

async function pictureOf(text: string, bold: boolean, size: number): Promise<Uint8Array | null> {
  const canvas = document.createElement("canvas");
  const style = `${bold ? "bold " : ""}${size * PIXELS}px ${getComputedStyle(document.body).fontFamily || "sans-serif"}`;
  const measure = canvas.getContext("2d");
  if (!measure) return null;
  measure.font = style;
  canvas.width = Math.ceil(measure.measureText(text).width) + 2 * PIXELS;
  canvas.height = Math.ceil(size * PIXELS * LINE);
  const draw = canvas.getContext("2d");
  if (!draw) return null;
  // Resizing has reset the style.
  draw.font = style;
  draw.fillStyle = "#2b2320";
  draw.textBaseline = "alphabetic";
  draw.fillText(text, PIXELS, canvas.height * (1 - DESCENT));
  const blob = await new Promise<Blob | null>((done) => canvas.toBlob(done, "image/png"));
  return blob && new Uint8Array(await blob.arrayBuffer());
}
