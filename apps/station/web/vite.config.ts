import { svelte } from '@sveltejs/vite-plugin-svelte';
import { defineConfig } from 'vite';

// The page is embedded in the program: few files, with fixed names.
export default defineConfig({
  plugins: [svelte()],
  build: {
    outDir: process.env.VSS_PAGE_OUT ?? 'dist',
    emptyOutDir: true,
    chunkSizeWarningLimit: 1200,
    modulePreload: false,
    rollupOptions: {
      output: {
        entryFileNames: 'app.js',
        chunkFileNames: '[name].js',
        assetFileNames: (asset) => (asset.names.some((n) => n.endsWith('.css')) ? 'app.css' : '[name][extname]'),
        manualChunks: (id) => (/node_modules\/three|src\/scene\.ts/.test(id) ? 'scene' : undefined),
      },
    },
    cssCodeSplit: false,
  },
  server: { proxy: { '/api': { target: process.env.VSS_STATION ?? 'http://127.0.0.1:8080', ws: true } } },
  test: { include: ['src/**/*.test.ts'] },
} as import('vite').UserConfig & { test: object });
