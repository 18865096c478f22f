// Builds the page into the folder named on the command line. The same lock file produces the same bytes.

import { build } from 'esbuild';
import { copyFile, mkdir, readFile, readdir, rm, writeFile } from 'node:fs/promises';
import { dirname, join, resolve } from 'node:path';
import { fileURLToPath } from 'node:url';

const room = dirname(fileURLToPath(import.meta.url));
const out = resolve(process.argv[2] ?? join(room, 'dist'));
const common = { absWorkingDir: room, bundle: true, minify: true, format: 'esm', target: ['es2022', 'safari16'], charset: 'utf8', legalComments: 'none', metafile: true, logLevel: 'warning' };

/** Leaves out the shader texts of three.js that the view's materials (basic, with its lines) do not include: a fifth of the bundle. */
const shaders = {
  name: 'shaders',
  setup({ onLoad }) {
    onLoad({ filter: /three\.module\.js$/ }, async ({ path }) => {
      const code = await readFile(path, 'utf8');
      const texts = new Map([...code.matchAll(/^(?:var|const) ([\w$]+) = ("(?:[^"\\]|\\.)*");$/gm)].map(([, name, text]) => [name, text]));
      const chunks = new Map([...code.matchAll(/^\t(\w+): ([\w$]+),?$/gm)].filter(([, , name]) => texts.has(name)).map(([, chunk, name]) => [chunk, name]));
      const kept = new Set();
      const keep = (chunk) => {
        const name = chunks.get(chunk);
        if (!name) throw new Error(`three.js has no shader chunk ${chunk}; update build.mjs`);
        if (kept.has(name)) return;
        kept.add(name);
        for (const [, inner] of texts.get(name).matchAll(/#include <(\w+)>/g)) keep(inner);
      };
      ['meshbasic_vert', 'meshbasic_frag', ...[...code.matchAll(/ShaderChunk\[ '(\w+)' \]/g)].map(([, chunk]) => chunk)].forEach(keep);
      const unused = new Set([...chunks.values()].filter((name) => !kept.has(name)));
      return { contents: code.replace(/^((?:var|const) ([\w$]+) = )"(?:[^"\\]|\\.)*";$/gm, (all, start, name) => (unused.has(name) ? `${start}"";` : all)) };
    });
  },
};

await rm(out, { recursive: true, force: true });
await mkdir(out, { recursive: true });
// Two bundles: the map comes first, the 3-D view is imported when it is first opened.
const page = await build({ ...common, entryPoints: ['src/main.js'], outfile: join(out, 'page.js'), external: ['./three.js'] });
const space = await build({ ...common, entryPoints: ['src/three.js'], outfile: join(out, 'three.js'), plugins: [shaders] });
await copyFile(join(room, 'src/index.html'), join(out, 'index.html'));
await writeFile(join(out, 'licences.txt'), await licences([page, space]));

/** Licence texts of exactly the packages that are in the bundles. */
async function licences(results) {
  const used = new Set();
  for (const { metafile } of results) for (const output of Object.values(metafile.outputs)) for (const [path, { bytesInOutput }] of Object.entries(output.inputs)) {
    const name = /node_modules\/((?:@[^/]+\/)?[^/]+)/.exec(path)?.[1];
    if (name && bytesInOutput) used.add(name);
  }
  const parts = [];
  for (const name of [...used].sort()) {
    const folder = join(room, 'node_modules', name);
    const { version, license } = JSON.parse(await readFile(join(folder, 'package.json'), 'utf8'));
    const file = (await readdir(folder)).sort().find((entry) => /^licen[cs]e/i.test(entry));
    parts.push(`${name} ${version} (${license})\n\n${file ? (await readFile(join(folder, file), 'utf8')).replaceAll('\r\n', '\n').trim() : 'The package carries no licence file.'}\n`);
  }
  return `The page contains these packages.\n\n${parts.join(`\n${'-'.repeat(72)}\n\n`)}`;
}
