// How the report looks.
#pragma once

namespace vss {

inline constexpr char kReportStyle[] = R"css(
:root{--ink:#18212b;--mute:#5b6875;--line:#dfe5eb;--back:#f4f6f8;--card:#fff;--accent:#0b63c5;--warn:#8a5a00;--warnback:#fff6e0}
*{box-sizing:border-box}
body{margin:0;background:var(--back);color:var(--ink);font:15px/1.5 system-ui,-apple-system,"Segoe UI",Roboto,"DejaVu Sans",sans-serif;font-variant-numeric:tabular-nums}
header{background:#101a26;color:#fff;padding:26px 0 30px}
header p{margin:2px 0 0;color:#a9b9c9}
main,header>div{max-width:1400px;margin:0 auto;padding:0 24px}
h1{font-size:27px;margin:0;font-weight:650;letter-spacing:-.01em}
h2{font-size:19px;margin:38px 0 12px;font-weight:650}
.tiles{display:grid;grid-template-columns:repeat(auto-fit,minmax(128px,1fr));gap:12px;margin-top:-16px}
.tile,.card{background:var(--card);border:1px solid var(--line);border-radius:10px;box-shadow:0 1px 2px #0f1b2a0d}
.tile{padding:12px 16px}.tile b{display:block;font-size:23px;font-weight:650;line-height:1.25}.tile span{color:var(--mute);font-size:13px}
.card{padding:16px;overflow-x:auto}
.warn{background:var(--warnback);border:1px solid #f0d48a;color:var(--warn);border-radius:10px;padding:10px 16px;margin-top:16px}
.warn ul{margin:4px 0;padding-left:20px}
table{border-collapse:collapse;width:100%;font-size:14px}
th{text-align:left;color:var(--mute);font-weight:600;font-size:12.5px;padding:6px 7px;border-bottom:1px solid var(--line);white-space:nowrap}
td{padding:8px 7px;border-bottom:1px solid var(--line);vertical-align:top}
tr:last-child>td{border-bottom:0}
td:first-child{white-space:nowrap}
td.n,th.n{text-align:right}td.n{white-space:nowrap}th.n{white-space:normal}
.chip{display:inline-block;width:11px;height:11px;border-radius:3px;margin-right:7px;vertical-align:-1px}
.dims{display:flex;flex-wrap:wrap;gap:3px 14px}.dims span{white-space:nowrap}.dims i{font-style:normal;color:var(--mute)}
.dims .no{color:var(--mute);border-bottom:1px dotted var(--mute);cursor:help}
.sig{color:var(--mute);font-size:12.5px}
.tag{display:inline-block;border-radius:99px;padding:0 9px;font-size:12px;font-weight:600;line-height:20px}
.ok{background:#e2f4e9;color:#14683a}.doubt{background:#ffe9d6;color:#9a4b00}
.two{display:grid;grid-template-columns:1fr 1fr;gap:14px}@media(max-width:980px){.two{grid-template-columns:1fr}}
figure{margin:0}figcaption{color:var(--mute);font-size:13px;margin-top:6px}
svg{display:block;width:100%;height:auto}
.plan .name,.plan text{font-family:inherit}.plan .name{font-weight:650;fill:#18212b;paint-order:stroke;stroke:#fff;stroke-width:.25em;stroke-opacity:.8}
.layers{position:sticky;top:0;z-index:2;background:var(--back);padding:10px 0;display:flex;flex-wrap:wrap;gap:6px 20px;align-items:center;font-size:14px;color:var(--mute)}
.layers label{display:flex;gap:6px;align-items:center;color:var(--ink);cursor:pointer}
.pics{display:grid;grid-template-columns:repeat(auto-fill,minmax(330px,1fr));gap:14px}
.pics figure{background:var(--card);border:1px solid var(--line);border-radius:10px;overflow:hidden;content-visibility:auto;contain-intrinsic-size:330px 380px}
.pics figcaption{padding:6px 12px 10px;margin:0;overflow-wrap:anywhere}.pics figcaption b{color:var(--ink);font-weight:600}
.pics svg{cursor:zoom-in;background:#000}
.pics figure.big{position:fixed;inset:0;z-index:9;border:0;border-radius:0;background:#0c1219;display:flex;flex-direction:column}
.pics figure.big svg{flex:1;min-height:0;cursor:zoom-out;background:none}.pics figure.big figcaption,.pics figure.big figcaption b{color:#cfd9e3}
.nolines .lines .free,.noused .lines .used,.noparts .parts,.nohidden .hidden,.nopicture .pics image{display:none}
.heat td{padding:3px 6px;text-align:center;font-size:12px;border:1px solid #fff;min-width:44px}
.heat th{padding:3px 6px;border:0}.heat th.up{writing-mode:vertical-rl;transform:rotate(180deg);font-weight:400;max-height:190px}
.bar{display:inline-block;height:10px;border-radius:3px;background:var(--accent);vertical-align:0}
details summary{cursor:pointer;color:var(--accent)}
footer{color:var(--mute);font-size:13px;padding:40px 0 30px}
@media print{.layers{display:none}body{background:#fff}.pics figure{break-inside:avoid}}
)css";

inline constexpr char kReportScript[] = R"js(
for(const box of document.querySelectorAll('.layers input'))
  box.onchange=()=>document.body.classList.toggle(box.value,!box.checked);
let big=null;
const close=()=>{if(big){big.classList.remove('big');big=null}};
for(const svg of document.querySelectorAll('.pics svg')){
  svg.onclick=()=>{const f=svg.parentElement;const was=f===big;close();if(!was){f.classList.add('big');big=f}};
}
addEventListener('keydown',e=>{
  if(e.key==='Escape')close();
  if(big&&(e.key==='ArrowRight'||e.key==='ArrowLeft')){
    const n=e.key==='ArrowRight'?big.nextElementSibling:big.previousElementSibling;
    if(n){close();n.classList.add('big');big=n}
  }
});
)js";

}  // namespace vss
